"""Sheets of paper at true scale: the scene's pattern in tiles, and boards to calibrate with."""
