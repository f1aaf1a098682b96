"""How wrong measurements may be beyond their noise: said once for all solvers."""

# Windows nearer to the back wall's edges than this share of the room are left out: the thermal layers beside
# side walls, floor and ceiling are thinner than a cell.
WALL_MARGIN = 0.06
# What a grid and a closure cannot represent is wrong in whole jets: so many neighbouring data count as one.
CORRELATED_DATA = 12.0
# Of the shifts' size, what a grid cannot represent.
REPRESENTATION = 0.3
# Noise of a known plane. Marched rooms add what their grid cannot represent, by the misfit.
PLANE_NOISE_K = 1e-3
# Noise of a known plane and what the vertices of a linear solve cannot represent of it.
PLANE_ON_VERTICES_K = 0.05
