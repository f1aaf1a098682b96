"""The experiment folder: its settings, captures, results and plan."""
