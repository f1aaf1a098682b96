"""The losses of a reconstruction: data, boundary, equations, smoothness."""
