"""Unknowns on a staggered grid, solved by Gauss-Newton."""
