"""Errors that all places of a volume have together: what goes with its mean, and with its rise over the height.

An interval of a mean over many places is wide if their errors go together and narrow if each is wrong by itself. Of
a field's covariance C, two rows tell the most of that: with the mean, and with the slope of the profile (b: what
either takes of each vertex). One standard deviation of each of the two, made independent, moves the whole field by

    C B (B' C B)^-1/2,      B = (b_mean, b_rise)

and what is left of the variance then is of places by themselves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Volume = Float[np.ndarray, "nx ny nz"]

# The room's mean and its profile's rise.
BROAD = 2
# A variance below this share of the larger one is lost in the rounding of the rows.
_ROUNDED = 1e-9


@dataclass(frozen=True)
class SharedErrors:
    """One sigma of each independent error on all vertices, and the weights that tell it, in sigmas, of a field."""

    fields: Float[np.ndarray, "errors nx ny nz"]
    weights: Float[np.ndarray, "errors nx ny nz"]

    def without(self, error: Volume) -> Volume:
        """What is left of an error of the field when its shared part is taken off."""
        sigmas = np.tensordot(self.weights, error, axes=3)
        return error - np.tensordot(sigmas, self.fields, axes=1)


def broad(shape: tuple[int, int, int]) -> Float[np.ndarray, "2 nx ny nz"]:
    """What the mean and the rise take of each vertex."""
    return np.stack([np.full(shape, 1.0 / np.prod(shape)), rise_of(shape)])


def rise_of(shape: tuple[int, int, int]) -> Volume:
    """The field whose product with a temperature is its rise from floor to ceiling, by least squares over height."""
    height = np.linspace(-0.5, 0.5, shape[2])
    rise = height / (np.sum(height**2) * shape[0] * shape[1])
    return np.broadcast_to(rise, shape).copy()


def shared_errors(rows: Float[np.ndarray, "2 nx ny nz"], rough: float = _ROUNDED) -> SharedErrors:
    """From the covariance of every vertex with the mean and with the rise: two errors, or fewer.

    An error is left out whose variance is below the share `rough` of the larger one: the rows do not tell it.
    """
    weights = broad(rows.shape[1:])
    covariance = np.tensordot(weights, rows, axes=((1, 2, 3), (1, 2, 3)))
    variances, ways = np.linalg.eigh((covariance + covariance.T) / 2)
    told = variances > max(rough * variances[-1], 0.0)
    turn = ways[:, told].T / np.sqrt(variances[told])[:, None]
    return SharedErrors(np.tensordot(turn, rows, axes=1), np.tensordot(turn, weights, axes=1))
