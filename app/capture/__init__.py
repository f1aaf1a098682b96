"""Taking a burst of frames into an experiment, and judging it."""
