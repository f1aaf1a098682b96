"""How wrong measurements may be beyond their noise: said once for all solvers."""

import numpy as np

# Windows nearer to the back wall's edges than this share of the room are left out: the thermal layers beside
# side walls, floor and ceiling are thinner than a cell.
WALL_MARGIN = 0.06
# What a grid and a closure cannot represent is wrong in whole jets: so many neighbouring data count as one. A marched
# room's data count by their correlation (`alike_share`).
CORRELATED_DATA = 12.0
# Correlation length of what a marched room has wrong, as a share of the room.
LENGTH_SHARE = 0.2
# Of the shifts' size, what a grid cannot represent.
REPRESENTATION = 0.3
# Noise of a known plane. Marched rooms add what their grid cannot represent, by the misfit.
PLANE_NOISE_K = 1e-3
# Noise of a known plane and what the vertices of a linear solve cannot represent of it.
PLANE_ON_VERTICES_K = 0.05


def alike_share(axes: int) -> float:
    """Share of a model error's variance that its mean over so many of the room's axes keeps.

    The mean of exp(-|a - b| / l) over a and b from 0 to 1, l the correlation length: once for each axis. So this
    share of the data that cover a wall is alike.
    """
    length = LENGTH_SHARE
    return float(2 * length - 2 * length**2 * (1 - np.exp(-1 / length))) ** axes
