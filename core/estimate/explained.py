"""How much of the measured shifts a room explains, beyond their noise."""

import equinox as eqx
import numpy as np

from core.estimate.image_noise import images
from core.estimate.observation import Observations
from core.room.vertices import RoomFields
from core.significance import TO_ONE_SIDE

# Share left that is assumed where the images do not tell it: there are none, or all that they show may be noise.
_UNSEEN_SHARE = 0.3
# A room that leaves more than this share lacks something.
_HALF = 0.5


class Explained(eqx.Module):
    """Rms shifts [px]: the measured signal, what a room predicts of it, what it leaves, and the noise.

    Noise is taken out of the first and of the third. These three hold how well its power is known, so that a picture
    that shows nothing but noise says nothing against a room. `noise_known` is that as a share of the power, one
    standard deviation.
    """

    measured_px: float
    predicted_px: float
    left_px: float
    noise_px: float
    noise_known: float

    @property
    def stands_out(self) -> bool:
        """Whether what is left is more than the noise may be misjudged by, in 19 pictures of 20."""
        beyond = self.left_px**2 / self.noise_px**2
        return beyond > TO_ONE_SIDE * self.noise_known

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
    if not data.shifts:
        return Explained(1.0, 1.0, _UNSEEN_SHARE, 1.0, 1.0)
    seen = images(data, fields)
    values, predicted, left, variance = seen.values_px, seen.predicted_px, seen.left_px, seen.variance_px2
    noise = float(variance.sum())
    # One standard deviation of the noise's power: of what it happens to be, and of what is known of it.
    drawn = float(np.sqrt(2.0 * np.sum(variance**2)))
    doubt = float(np.hypot(drawn, seen.known * noise))

    def rms(power: float) -> float:
        return float(np.sqrt(max(power, np.finfo(np.float32).tiny) / len(values)))

    return Explained(
        rms(max(float(values @ values) - noise, 0.0) + doubt),
        rms(float(predicted @ predicted) + doubt),
        rms(max(float(left @ left) - noise, 0.0) + _UNSEEN_SHARE**2 * doubt),
        rms(noise),
        doubt / noise,
    )


def likeness(data: Observations, fields: RoomFields) -> float:
    """Correlation of the measured signal with what these fields show, -1 to 1.

    Noise is taken out of the signal's size. 0 where there are no images, and where noise alone correlates as much in
    one picture of twenty.
    """
    if not data.shifts:
        return 0.0
    seen = images(data, fields)
    product = float(seen.values_px @ seen.predicted_px)
    by_noise = float(np.sqrt(np.sum(seen.variance_px2 * seen.predicted_px**2)))
    if abs(product) <= TO_ONE_SIDE * by_noise:
        return 0.0
    signal = explained(data, fields).measured_px * np.sqrt(len(seen.values_px))
    return float(np.clip(product / (signal * np.linalg.norm(seen.predicted_px)), -1.0, 1.0))
