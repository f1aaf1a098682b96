"""How wrong measurements may be beyond their noise: said once for all solvers."""

import numpy as np
from jaxtyping import Float

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


def independent_share(
    left: Float[np.ndarray, " data"], noise: Float[np.ndarray, " data"], alike: float
) -> float:
    """The share of these data that counts: `alike` neighbours have a model's error in common, each has its own noise.

    `left` is what a model leaves of them and `noise` their variance: 1 where noise is all that is left, and
    1 / `alike` where the model's error is.
    """
    noise_power = float(np.mean(noise))
    power = max(float(np.mean(left**2)), noise_power)
    return power / (noise_power + alike * (power - noise_power))
