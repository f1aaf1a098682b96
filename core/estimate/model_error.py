"""How wrong the model of the air is, by place: in units of what two closures, and two grids, differ in.

    std^2 = nu / (nu - 2)  k^2  sum over pairs <d^2> / 2,   d = (f_other - f) - D m

    m minimises |s_other - s - J m|^2 / R + |m|^2

f is a field and s what the data would show of it, under one closure and another, or on two grids; m is how far the
parameters would move if the data were the other model's, D and J the derivatives of f and s in them. So d is what the
fit could not take up; two models that are equally wrong by themselves differ by sqrt(2) times as much as either is
wrong. <> is a mean over a correlation length. k is the ratio of what the fitted room leaves of the images, beyond
their noise, to what d / sqrt(2) would leave: expected to be 1, known within a factor e, and moved by the likelihood.
Where the images do not tell two models apart it stays 1. A room that leaves far more of the
images than models differ in lacks something, such as a heater that nobody stated. Where a room with such a heater
explains the images about as well, the truth may be either: the two are one more pair, whose size is 1.

d at a point is one draw of three components. An error whose variance is known from three squares has Student's t
distribution with nu = 3 (Gosset, Biometrika 6 (1908)), whose standard deviation is sqrt(3) times as large. That is
for a point's interval. A mean over the room has many draws: the mean of <d^2> / 2 is that of the error's square, with
no such factor (`mean_square`). Likewise k m / sqrt(2) is how far what the model has wrong moves the parameters
(`moves`).
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import ndimage
from scipy.optimize import minimize_scalar

from core.data_error import LENGTH_SHARE
from core.estimate.forward_runs import Derivatives
from core.estimate.image_noise import images, projected
from core.estimate.least_squares import Posterior
from core.estimate.observation import IMAGES, Observations
from core.room.vertices import RoomFields
from core.significance import TO_ONE_SIDE

Pair = tuple[RoomFields, RoomFields]

_STUDENT = 3.0
# Of the squared difference of two models, what either has wrong.
EACH = 0.5
# Of the logarithm of k: within e^4 either way.
_FARTHEST = 4.0


class ModelError(eqx.Module):
    """Pairs of rooms that may be wrong by what they differ in, how each would move the parameters, and its size.

    `moved` is in prior deviations. `size` is k, and 1 for a pair of rivals. `left_ratio` is what the room leaves of
    the images beyond their noise, over what the models' pairs would leave, both rms: k without the prior.
    """

    pairs: tuple[Pair, ...]
    moved: Float[np.ndarray, "pairs active"]
    size: Float[np.ndarray, " pairs"]
    left_ratio: float

    @property
    def lacks(self) -> bool:
        """Whether the room lacks something: it leaves more of the images than k may be, in 19 rooms of 20."""
        return self.left_ratio > float(np.exp(TO_ONE_SIDE))

    @property
    def moves(self) -> Float[np.ndarray, " active"]:
        """How far what the model has wrong moves each parameter, one standard deviation, in prior deviations."""
        return np.sqrt(EACH * np.sum((self.size[:, None] * self.moved) ** 2, axis=0))

    def deviation(
        self, name: str, derivatives: Float[np.ndarray, "active vx vy vz ..."]
    ) -> Float[np.ndarray, "vx vy vz ..."]:
        """One standard deviation of the field of this name; `derivatives` are its own, per prior deviation."""
        return np.sqrt(_STUDENT / (_STUDENT - 2.0) * self._variance(name, derivatives))

    def mean_square(self, name: str, derivatives: Float[np.ndarray, "active vx vy vz ..."]) -> float:
        """The expected square of the field's error, mean over the room."""
        return float(np.mean(self._variance(name, derivatives)))

    def apart(
        self, name: str, derivatives: Float[np.ndarray, "active vx vy vz ..."]
    ) -> list[Float[np.ndarray, "vx vy vz ..."]]:
        """What each pair differs in and no parameter takes up."""
        return [
            getattr(other, name) - getattr(one, name) - np.tensordot(moved, derivatives, axes=1)
            for (one, other), moved in zip(self.pairs, self.moved, strict=True)
        ]

    def _variance(
        self, name: str, derivatives: Float[np.ndarray, "active vx vy vz ..."]
    ) -> Float[np.ndarray, "vx vy vz ..."]:
        variance = np.zeros(getattr(self.pairs[0][0], name).shape)
        for apart, size in zip(self.apart(name, derivatives), self.size, strict=True):
            if apart.ndim == 3:
                # The mean of p at each height follows that of T, of which the last correction knows more.
                apart = apart - apart.mean((0, 1))
            # A mean over one correlation length: one standard deviation to each side.
            width = [0.5 * LENGTH_SHARE * n for n in apart.shape[:3]] + [0.0] * (apart.ndim - 3)
            variance += size**2 * EACH * ndimage.gaussian_filter(apart**2, width)
        return variance


def model_error(
    data: Observations,
    posterior: Posterior,
    derivatives: Derivatives,
    pairs: tuple[Pair, ...],
    found: RoomFields,
    rivals: Pair | None = None,
) -> ModelError:
    """The error of the model that ended in the room `found`; either of two `rivals` may be the truth."""
    models, pairs = len(pairs), pairs if rivals is None else (*pairs, rivals)
    jacobian = derivatives.per_deviation(data.predicted).T
    between = [data.predicted(other) - data.predicted(one) for one, other in pairs]
    if len(posterior.deviation):
        variance = posterior.deviation**2
        slopes = data.unshared(jacobian, variance)
        weighted = slopes.T / variance
        normal = weighted @ slopes + np.eye(len(posterior.vector))
        moved = np.stack(
            [np.linalg.solve(normal, weighted @ data.unshared(apart, variance)) for apart in between]
        )
    else:
        moved = np.zeros((len(pairs), len(posterior.vector)))
    seen = images(data, found)
    apart = np.stack([s - jacobian @ m for s, m in zip(between, moved, strict=True)])
    shown = data.values()[2] == IMAGES
    apart = np.stack([projected(data, of[shown]) for of in apart[:models]])
    left, noise = seen.left_px, seen.variance_px2
    size = np.ones(len(pairs))
    size[:models] = size_of(left, noise, apart, data.alike()[shown])
    return ModelError(pairs, moved, size, _left_ratio(left, noise, apart))


def _left_ratio(
    left: Float[np.ndarray, " data"],
    noise: Float[np.ndarray, " data"],
    apart: Float[np.ndarray, "pairs data"],
) -> float:
    if not len(left):
        return 1.0
    beyond = max(float(np.mean(left**2) - np.mean(noise)), 0.0)
    return float(np.sqrt(beyond / max(_unit_power(apart), float(np.finfo(np.float32).tiny))))


def size_of(
    left: Float[np.ndarray, " data"],
    noise: Float[np.ndarray, " data"],
    apart: Float[np.ndarray, "pairs data"],
    alike: Float[np.ndarray, " data"],
) -> float:
    """The likeliest k, from what a room leaves of the images and their noise's variance; 1 without images."""
    if not len(left):
        return 1.0
    independent = float(np.sum(1.0 / alike))
    power, noise_power, unit = np.mean(left**2), np.mean(noise), _unit_power(apart)

    def unlikely(log_size: float) -> float:
        variance = noise_power + np.exp(2.0 * log_size) * unit
        return float(0.5 * independent * (np.log(variance) + power / variance) + 0.5 * log_size**2)

    found = minimize_scalar(unlikely, bounds=(-_FARTHEST, _FARTHEST), method="bounded")
    return float(np.exp(found.x))


def _unit_power(apart: Float[np.ndarray, "pairs data"]) -> float:
    """Mean square of what a model that is as wrong as the pairs differ would leave of a datum."""
    return EACH * float(np.mean(np.sum(apart**2, axis=0)))
