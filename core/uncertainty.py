"""Standard deviations of a marched room: from its parameters, from its grid, from the last correction.

    var = D C D^T + (a |f_fine - f_coarse| smoothed + b s)^2 + var_correction

D holds the fields' derivatives in the fitted parameters and C their posterior covariance. The second term
is what a grid cannot represent: two grids differ by about what the finer one still lacks. a and b were set
once so that 95 % intervals hold on the reference rooms; s is the field's own scale.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import ndimage

Field = Float[np.ndarray, "vx vy vz ..."]

# Share of the two grids' difference, and floor as a share of the field's departure from its profile.
_GRID_SHARE, _FLOOR_SHARE = 0.7, 0.06
_SMOOTH_VERTICES = 2.5


class Deviation(eqx.Module):
    """One sigma on vertices, and the share of the prior variance that the measurements removed (0 to 1)."""

    std: Field
    informed: Field


def deviation(
    derivatives: list[Field],
    covariance: Float[np.ndarray, "active active"],
    grid_difference: Field,
    scale: float,
    extra: tuple[Field | float, Field | float] = (0.0, 0.0),
) -> Deviation:
    """Combine the three terms; parameters are in units of their prior deviations.

    `scale` is the field's own scale; `extra` are a correction's variances before and after the data.
    """
    roots = np.linalg.cholesky(covariance) if len(derivatives) else np.zeros((0, 0))
    stacked = np.stack(derivatives) if derivatives else np.zeros((0, *grid_difference.shape))
    after = np.sum(np.tensordot(roots.T, stacked, axes=1) ** 2, axis=0) + extra[1]
    before = np.sum(stacked**2, axis=0) + extra[0]
    sigma = [_SMOOTH_VERTICES] * 3 + [0.0] * (grid_difference.ndim - 3)
    smooth = np.sqrt(ndimage.gaussian_filter(np.square(grid_difference), sigma))
    represented = _GRID_SHARE * smooth + _FLOOR_SHARE * scale
    informed = 1.0 - (after + represented**2) / (before + represented**2)
    return Deviation(np.sqrt(after + represented**2), np.clip(informed, 0.0, 1.0))
