"""Standard deviations of a marched room: from its parameters, grid, closure and last correction.

    var = D C D^T + (a |f_fine - f_coarse| + c m |f_other - f_coarse| + b r s)^2 + var_correction

D holds the fields' derivatives in the fitted parameters, and C is their posterior covariance. The second term is
the representation error of grid and closure: two grids differ by about the error of the finer one, and two closures
by about the error of either. Both differences are smoothed. s is the rms size of the field. m is what the room
leaves of the images, as a share of their signal, and r the same as a share of the room's own. a, b and c were set so
that 95 % intervals hold: for u and p on two reference rooms (A and C), for T on six rooms, four of which have another
closure or a plume.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import ndimage

Field = Float[np.ndarray, "vx vy vz ..."]

# Standard deviation of the smoothing [vertices].
_SMOOTH_VERTICES = 2.5


class Represented(eqx.Module):
    """Representation error: differences of two grids and of two closures, the scale s, and a, c m, b r."""

    grid: Field
    closure: Field
    scale: float
    shares: tuple[float, float, float] = eqx.field(static=True)

    def deviation(self) -> Field:
        """One sigma."""
        sigma = [_SMOOTH_VERTICES] * 3 + [0.0] * (self.grid.ndim - 3)
        grid, closure = (
            np.sqrt(ndimage.gaussian_filter(np.square(d), sigma)) for d in (self.grid, self.closure)
        )
        a, c, b = self.shares
        return a * grid + c * closure + b * self.scale


class Deviation(eqx.Module):
    """One sigma on vertices, and the share of the prior variance that the measurements removed (0 to 1)."""

    std: Field
    informed: Field


def deviation(
    stated: Float[np.ndarray, "active vx vy vz ..."],
    derivatives: Float[np.ndarray, "active vx vy vz ..."],
    covariance: Float[np.ndarray, "active active"],
    represented: Represented,
    extra: tuple[Field | float, Field | float] = (0.0, 0.0),
) -> Deviation:
    """Combine the three terms; derivatives are per prior deviation, `stated` about the room as stated.

    `extra` are the correction's prior and posterior variances.
    """
    roots = np.linalg.cholesky(covariance)
    after = np.sum(np.tensordot(roots.T, derivatives, axes=1) ** 2, axis=0) + extra[1]
    before = np.sum(stated**2, axis=0) + extra[0]
    # Where nothing is uncertain, `informed` is 0.
    left = represented.deviation() ** 2 + np.finfo(np.float32).tiny
    informed = 1.0 - (after + left) / (before + left)
    return Deviation(np.sqrt(after + left), np.clip(informed, 0.0, 1.0))
