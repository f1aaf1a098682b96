"""The rig: cameras, projectors, pattern display and their simulated twins. Bytes, frames, seconds."""
