"""The noise of the shifts, as the shifts themselves show it.

Along a ray that leaves the camera towards theta, air deflects light by the integral of t dn/dr over the way t. That
is the gradient in theta of one number for each ray, the integral of n. So shifts that air causes are a gradient over
the picture and have no curl, while the errors of a sensor or of a rippling lamp have as much curl as divergence. The
part of the shifts that is no gradient therefore says how large their noise is, whatever the air does.

What a room predicts is taken off first: shifts grow towards the wall's end of the ray, so a wide lens before a near
wall sees a gradient that is slightly bent. Of what a room leaves that is small.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse
from scipy.linalg import svd
from scipy.optimize import minimize_scalar

from core.estimate.observation import IMAGES, Observations, ShiftBlocks
from core.room.vertices import RoomFields

# A window's stated variance is right within this share: in simulated labs its errors scatter by 0.9 to 1.2 of it.
NOISE_KNOWN = 0.2
# Singular values below this share of the largest are rounding: a potential's constant, and its checkerboard.
_RANK = 1e-8
_TINY = float(np.finfo(float).tiny)
# Of the logarithm of the factor: within e^3 either way.
_FARTHEST = 3.0


class Images(eqx.Module):
    """Shifts of all views: measured, as a room predicts them, and their noise's variance as what it leaves shows.

    What the camera may have done, or another error that the windows share, is taken out of both (`projected`).
    `known` is the share that the noise's power may be wrong by, one standard deviation.
    """

    values_px: Float[np.ndarray, " shifts"]
    predicted_px: Float[np.ndarray, " shifts"]
    variance_px2: Float[np.ndarray, " shifts"]
    known: float

    @property
    def left_px(self) -> Float[np.ndarray, " shifts"]:
        """What the room leaves of the shifts."""
        return self.values_px - self.predicted_px


def images(data: Observations, fields: RoomFields) -> Images:
    """The shifts beside what these fields show of them; empty arrays where there are none."""
    values, variance, group = data.values()
    shown = group == IMAGES
    values, predicted = (projected(data, of[shown]) for of in (values, data.predicted(fields)))
    variance = variance[shown].copy()
    doubt = 0.0
    for blocks, own in data.views():
        factor, known = noise_factor(blocks, (values - predicted)[own].reshape(-1, 2))
        variance[own] *= factor
        doubt += (known * float(variance[own].sum())) ** 2
    return Images(values, predicted, variance, doubt**0.5 / max(float(variance.sum()), _TINY))


def with_noise_seen(data: Observations, fields: RoomFields) -> Observations:
    """The data, their images' noise as what these fields leave of them shows."""
    seen, scaled = images(data, fields), []
    for blocks, own in data.views():
        variance = seen.variance_px2[own].reshape(-1, 2)
        scaled.append(eqx.tree_at(lambda of: of.variance_px2, blocks, variance))
    return eqx.tree_at(lambda of: of.shifts, data, tuple(scaled))


def projected(data: Observations, shifts_px: Float[np.ndarray, " shifts"]) -> Float[np.ndarray, " shifts"]:
    """Shifts of all views without the errors that windows share, fitted to them at any size."""
    rest = shifts_px.copy()
    for blocks, own in data.views():
        if blocks.shared_px.shape[2]:
            std = np.sqrt(blocks.variance_px2).ravel()
            shared, *_ = svd(blocks.shared_px.reshape(len(std), -1) / std[:, None], full_matrices=False)
            rest[own] -= std * (shared @ (shared.T @ (shifts_px[own] / std)))
    return rest


def noise_factor(blocks: ShiftBlocks, left_px: Float[np.ndarray, "blocks 2"]) -> tuple[float, float]:
    """By what the variance of these blocks is to be multiplied, and how well that is known (its share).

    `left_px` is what a room leaves of them. The stated variance is right within `NOISE_KNOWN`; the curl moves it by
    its likelihood.
    """
    left = left_px / np.sqrt(blocks.variance_px2)
    gradients = _gradients(blocks.cell) / np.sqrt(blocks.variance_px2).reshape(-1, 1)
    basis, singular, _ = svd(gradients, full_matrices=False)
    basis = basis[:, singular > _RANK * singular[0]]
    curl = left.ravel() - basis @ (basis.T @ left.ravel())
    free = left.size - basis.shape[1]
    power = float(curl @ curl)

    def unlikely(log_factor: float) -> float:
        return 0.5 * (free * log_factor + power * np.exp(-log_factor) + (log_factor / NOISE_KNOWN) ** 2)

    found = minimize_scalar(unlikely, bounds=(-_FARTHEST, _FARTHEST), method="bounded")
    return float(np.exp(found.x)), float((0.5 * free + NOISE_KNOWN**-2) ** -0.5)


def _gradients(cell: Int[np.ndarray, "blocks 2"]) -> Float[np.ndarray, "shifts corners"]:
    """The mean gradient over each block of a potential that is given at the blocks' corners."""
    cell = cell - cell.min(0)
    shape = cell.max(0) + 2
    rows, columns, values = [], [], []
    for along in (0, 1):
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
            rows.append(2 * np.arange(len(cell)) + along)
            columns.append(np.ravel_multi_index((cell + corner).T, shape))
            values.append(np.full(len(cell), corner[along] - 0.5))
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sparse.coo_array(entries, (2 * len(cell), int(np.prod(shape)))).toarray()
