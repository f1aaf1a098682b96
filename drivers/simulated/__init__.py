"""Simulated twins of the devices, behind the same Protocols. Used by `app.rig` and tests only."""
