"""Calibration of a rig step by step, by guided pictures or from files."""
