"""How much of the measured shifts a room explains, beyond their noise."""

import equinox as eqx
import numpy as np

from core.estimate.observation import IMAGES, Observations
from core.room.vertices import RoomFields

# Share left that is assumed where the images do not tell it: there are none, or all that they show may be noise.
_UNSEEN_SHARE = 0.3
# A window's stated variance is right within this share: in simulated labs its errors scatter by 0.9 to 1.2 of it.
_NOISE_KNOWN = 0.2
# A room that leaves more than this share lacks something.
_HALF = 0.5


class Explained(eqx.Module):
    """Rms shifts [px]: the measured signal, what a room predicts of it, what it leaves, and the noise.

    Noise is taken out of the first and of the third. These three hold how well its power is known, so that a picture
    that shows nothing but noise says nothing against a room.
    """

    measured_px: float
    predicted_px: float
    left_px: float
    noise_px: float

    @property
    def stands_out(self) -> bool:
        """Whether what is left is more than the noise may be misjudged by."""
        return self.left_px**2 > _NOISE_KNOWN * self.noise_px**2

    @property
    def half_left(self) -> bool:
        """Whether more than half of the measured signal is left."""
        return self.share_left > _HALF

    @property
    def share_left(self) -> float:
        """Share of the measured signal that is left, 0 to 1 and more."""
        return self.left_px / self.measured_px

    @property
    def left_over_own(self) -> float:
        """What is left, over the room's own signal: more than the share left where the room lacks something."""
        return self.left_px / self.predicted_px


def explained(data: Observations, fields: RoomFields) -> Explained:
    """What these fields explain of the images; a share of 0.3 is left where there are none."""
    values, variance, group = data.values()
    shifts = group == IMAGES
    if not shifts.any():
        return Explained(1.0, 1.0, _UNSEEN_SHARE, 1.0)
    values, predicted, variance = values[shifts], data.predicted(fields)[shifts], variance[shifts]
    noise = float(variance.sum())
    # One standard deviation of the noise's power.
    doubt = float(np.sqrt(2.0 * np.sum(variance**2)))

    def rms(power: float) -> float:
        return float(np.sqrt(max(power, np.finfo(np.float32).tiny) / len(values)))

    left = values - predicted
    return Explained(
        rms(max(float(values @ values) - noise, 0.0) + doubt),
        rms(float(predicted @ predicted) + doubt),
        rms(max(float(left @ left) - noise, 0.0) + _UNSEEN_SHARE**2 * doubt),
        rms(noise),
    )


def likeness(data: Observations, fields: RoomFields) -> float:
    """Correlation of the measured shifts with what these fields show, -1 to 1; 0 where there are no images."""
    values, _, group = data.values()
    shifts = group == IMAGES
    predicted = data.predicted(fields)[shifts]
    size = float(np.linalg.norm(values[shifts]) * np.linalg.norm(predicted))
    return float(values[shifts] @ predicted) / max(size, float(np.finfo(np.float32).tiny))
