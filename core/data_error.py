"""How wrong measurements may be beyond their noise: said once for all solvers."""

import numpy as np

# Windows nearer to the back wall's edges than this share of the room are left out: the thermal layers beside
# side walls, floor and ceiling are thinner than a cell.
WALL_MARGIN = 0.06
# What a grid and a closure cannot represent is wrong in whole jets: so many neighbouring data count as one.
CORRELATED_DATA = 12.0
# Where a room is marched, what it has wrong is correlated over this share of the room (`alike_share`).
LENGTH_SHARE = 0.2
# Of the shifts' size, what a grid cannot represent.
REPRESENTATION = 0.3
# Noise of a known plane. Marched rooms add what their grid cannot represent, by the misfit.
PLANE_NOISE_K = 1e-3
# Noise of a known plane and what the vertices of a linear solve cannot represent of it.
PLANE_ON_VERTICES_K = 0.05


def alike_share(axes: int) -> float:
    """Share of the variance that an error of a marched room keeps in its mean over so many of the room's axes.

    For one axis the mean of exp(-|a - b| / l) over a and b from 0 to 1, where l is the correlation length. Of n data
    that cover a wall, n times the share for two axes count as one.
    """
    one = 2 * LENGTH_SHARE - 2 * LENGTH_SHARE**2 * (1 - np.exp(-1 / LENGTH_SHARE))
    return float(one) ** axes
