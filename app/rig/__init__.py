"""The rig of an experiment, opened: camera, projector, screen, the pattern on it, and their live views."""
