"""Simulated projectors: a state with a warm-up clock, a responder for each dialect, a terminal or TCP."""
