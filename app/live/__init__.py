"""T of each burst as soon as it is on disk, while a series is taken."""
