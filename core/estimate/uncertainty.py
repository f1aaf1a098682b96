"""Standard deviations of a marched room: from its parameters, the model of the air, and the last correction.

    var = D C D^T + var_model + var_correction

D holds the fields' derivatives in the fitted parameters, and C is their posterior covariance. What the model of the
air has wrong is in `core.estimate.model_error`.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

Field = Float[np.ndarray, "vx vy vz ..."]


class Deviation(eqx.Module):
    """One sigma on vertices, and the share of the prior variance that the measurements removed (0 to 1)."""

    std: Field
    informed: Field


def deviation(
    derivatives: Float[np.ndarray, "active vx vy vz ..."],
    covariance: Float[np.ndarray, "active active"],
    model_std: Field | float,
    extra: tuple[Field | float, Field | float] = (0.0, 0.0),
) -> Deviation:
    """Combine the three terms; derivatives are per prior deviation.

    `extra` are the correction's prior and posterior variances.
    """
    after = np.sum(errors_of(derivatives, covariance) ** 2, axis=0) + extra[1]
    before = np.sum(derivatives**2, axis=0) + extra[0]
    # Where nothing is uncertain, `informed` is 0.
    left = np.square(model_std) + np.finfo(np.float32).tiny
    informed = 1.0 - (after + left) / (before + left)
    return Deviation(np.sqrt(after + left), np.clip(informed, 0.0, 1.0))


def errors_of(
    derivatives: Float[np.ndarray, "active vx vy vz ..."], covariance: Float[np.ndarray, "active active"]
) -> Float[np.ndarray, "active vx vy vz ..."]:
    """What parameters of this covariance have wrong: independent errors of a field, one sigma each."""
    return np.tensordot(np.linalg.cholesky(covariance).T, derivatives, axes=1)
