"""Experiments made from a room volume: the whole chain without hardware."""
