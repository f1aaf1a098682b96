"""A sequence of bursts, each as its departure from the mean."""
