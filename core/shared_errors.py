"""Errors that all places of a volume have together: what goes with its profile over the height.

An interval of a mean over many places is wide if their errors go together and narrow if each is wrong by itself. Of
a field's covariance C, a few rows tell the most of that: with the mean, with the rise of the profile, and with its
finer shapes (b: what each takes of every vertex; Legendre's polynomials of the height). One standard deviation of
each, made independent, moves the whole field by

    C B (B' C B)^-1/2,      B = (b_mean, b_rise, ...)

and what is left of the variance then is of places by themselves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Volume = Float[np.ndarray, "nx ny nz"]

# The mean and the rise alone.
BROAD = 2
# A variance below this share of the largest one is lost in the rounding of the rows.
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


def broad(shape: tuple[int, int, int], count: int = BROAD) -> Float[np.ndarray, "count nx ny nz"]:
    """Weights that read a field's mean, its rise from floor to ceiling, and finer shapes of its profile.

    Each is fitted by least squares over the height to what those before it leave. The second is the difference of
    ceiling and floor; finer shapes are scaled as it is, by twice the factor of their polynomial.
    """
    polynomials = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, shape[2]), count - 1)
    across, scale = np.linalg.qr(polynomials)
    taken = across / np.diag(scale) / (shape[0] * shape[1])
    taken[:, 1:] *= 2.0
    return np.broadcast_to(taken.T[:, None, None], (count, *shape)).copy()


def shared_errors(rows: Float[np.ndarray, "count nx ny nz"], rough: float = _ROUNDED) -> SharedErrors:
    """From the covariance of every vertex with what `broad` takes of all: as many errors, or fewer.

    An error is left out whose variance is below the share `rough` of the largest one: the rows do not tell it.
    """
    weights = broad(rows.shape[1:], len(rows))
    covariance = np.tensordot(weights, rows, axes=((1, 2, 3), (1, 2, 3)))
    variances, ways = np.linalg.eigh((covariance + covariance.T) / 2)
    told = variances > max(rough * variances[-1], 0.0)
    turn = ways[:, told].T / np.sqrt(variances[told])[:, None]
    return SharedErrors(np.tensordot(turn, rows, axes=1), np.tensordot(turn, weights, axes=1))
