"""The weighted mean of several marched rooms that fits the data best (stacking: Breiman 1996).

Air that does not settle, and walls that change it slowly, make each marched room partly chance. A mean of several is
less so.
"""

from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from core.estimate.observation import Observations
from core.estimate.parameter_step import variance_of
from core.room.vertices import RoomFields

Weights = Float[np.ndarray, " rooms"]


def weights_of_least_misfit(data: Observations, rooms: Sequence[RoomFields], best: int) -> Weights:
    """The weights with which the rooms' mean fits the data best: none is below 0, and they add up to 1.

    So the mean lies between the rooms, and no difference of two is enlarged. Each datum is weighted by its noise and
    by what the room `best`, an index, leaves of its kind.
    """
    left = [data.values()[0] - data.predicted(room) for room in rooms]
    variance = variance_of(data, left[best], left[best])
    misfits = np.stack([data.unshared(of, variance) / np.sqrt(variance) for of in left], axis=-1)
    scale = float(np.linalg.norm(misfits[:, best]))
    if scale == 0.0:
        return np.eye(len(rooms))[best]
    # The sum is asked for as one more datum. Weights s v with sum(v) = 1 and the best s leave a sum of squares that
    # rises with |misfits v| alone, so v solves the problem with the sum held.
    weights, _ = nnls(
        np.vstack([misfits, np.full(len(rooms), scale)]), np.append(np.zeros(len(misfits)), scale)
    )
    return weights / weights.sum()


def mean_fields(rooms: Sequence[RoomFields], weights: Weights) -> RoomFields:
    """The rooms' weighted mean."""
    return jax.tree.map(lambda *fields: np.tensordot(weights, np.stack(fields), axes=1), *rooms)
