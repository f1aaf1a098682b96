"""Standard deviations of a marched room: from its parameters, grid, closure and last correction.

    var = D C D^T + (a |f_fine - f_coarse| smoothed + c |f_other - f_coarse| smoothed + b s)^2 + var_correction

D holds the fields' derivatives in the fitted parameters and C their posterior covariance. The second term
is what a grid and a closure cannot represent: two grids differ by about what the finer one still lacks,
two closures by about what either does. a, b and c were set once so that 95 % intervals hold on rooms of
several closures; s is the field's own scale times the share of the images that is left unexplained.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import ndimage

Field = Float[np.ndarray, "vx vy vz ..."]

# Shares of the differences of grids and of closures, and of s.
_GRID_SHARE, _CLOSURE_SHARE, _FLOOR_SHARE = 0.7, 0.4, 0.4
_SMOOTH_VERTICES = 2.5


class Deviation(eqx.Module):
    """One sigma on vertices, and the share of the prior variance that the measurements removed (0 to 1)."""

    std: Field
    informed: Field


def deviation(
    derivatives: list[Field],
    covariance: Float[np.ndarray, "active active"],
    differences: tuple[Field, Field],
    scale: float,
    extra: tuple[Field | float, Field | float] = (0.0, 0.0),
) -> Deviation:
    """Combine the three terms; parameters are in units of their prior deviations.

    `differences` are those of two grids and of two closures; `scale` is s; `extra` are
    a correction's variances before and after the data.
    """
    roots = np.linalg.cholesky(covariance) if len(derivatives) else np.zeros((0, 0))
    stacked = np.stack(derivatives) if derivatives else np.zeros((0, *differences[0].shape))
    after = np.sum(np.tensordot(roots.T, stacked, axes=1) ** 2, axis=0) + extra[1]
    before = np.sum(stacked**2, axis=0) + extra[0]
    sigma = [_SMOOTH_VERTICES] * 3 + [0.0] * (differences[0].ndim - 3)
    grid, closure = (np.sqrt(ndimage.gaussian_filter(np.square(d), sigma)) for d in differences)
    represented = _GRID_SHARE * grid + _CLOSURE_SHARE * closure + _FLOOR_SHARE * scale
    informed = 1.0 - (after + represented**2) / (before + represented**2)
    return Deviation(np.sqrt(after + represented**2), np.clip(informed, 0.0, 1.0))
