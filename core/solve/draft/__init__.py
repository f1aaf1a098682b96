"""Temperature alone, by a linear solve."""
