"""How many of a march's last windows its mean is taken over.

The air of a marched room may never come to rest: then the mean over a longer time is less a matter of chance. But
the beginning of a march is not yet the room. White's rule (MSER, Simulation 69, 1997) weighs both, and has no
constant. Of all the last m windows x it takes those of the least

    sum |x_i - mean|^2 / m^2,

the variance of their mean, if windows differ by chance alone. One window tells no variance, so m is at least two.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from core.room.step import Flow


def settled_windows(windows: Sequence[Flow]) -> int:
    """How many of the last windows the mean is taken over: as many as both velocity and temperature allow."""
    of_velocity = [np.concatenate([np.ravel(of) for of in flow.velocity]) for flow in windows]
    of_excess = [np.ravel(flow.excess_k) for flow in windows]
    return min(_settled(of_velocity), _settled(of_excess))


def _settled(fields: Sequence[Float[np.ndarray, " values"]]) -> int:
    """How many of the last fields have the least variance of their mean."""
    apart = np.stack(fields).astype(float) - np.asarray(fields[-1], float)
    products = (apart @ apart.T)[::-1, ::-1]
    counts = range(2, len(fields) + 1)
    variances = [_scatter(products[:m, :m]) / m**2 for m in counts]
    return 2 + int(np.argmin(variances)) if variances else len(fields)


def _scatter(products: Float[np.ndarray, "some some"]) -> float:
    """Sum of the squared distances of some fields from their mean, by their products with one another."""
    return float(np.trace(products) - products.sum() / len(products))
