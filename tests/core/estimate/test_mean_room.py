"""The mean of several rooms that leaves least of the data."""

import numpy as np
import pytest

from core.estimate.mean_room import mean_fields, weights_of_least_misfit
from core.estimate.observation import observations
from tests.core.estimate.test_explained import VERTICES, room_of, seen

# The pictures are of air that is warmer by 4 K at the ceiling.
WARMER_K = 4.0


@pytest.mark.parametrize(
    ("warmer_k", "wanted"),
    [
        # Between two rooms that err to either side, by how far each is off.
        ((3.0, 7.0), (0.75, 0.25)),
        # Rooms that all err to one side: the nearest alone, and no difference is enlarged.
        ((3.0, 2.0, 1.0), (1.0, 0.0, 0.0)),
        # A room that is right needs no other.
        ((4.0, 0.0), (1.0, 0.0)),
        ((2.5,), (1.0,)),
    ],
)
def test_the_weights_are_those_of_the_least_misfit(warmer_k: tuple[float, ...], wanted: tuple[float, ...]):
    data = observations(seen(WARMER_K, 0.05), VERTICES)

    weights = weights_of_least_misfit(data, [room_of(k) for k in warmer_k], 0)
    np.testing.assert_allclose(weights, wanted, atol=0.02)
    assert weights.sum() == pytest.approx(1.0)


def test_the_mean_is_one_of_every_field():
    one, other = room_of(1.0), room_of(3.0)
    found = mean_fields([one, other], np.array([0.25, 0.75]))

    np.testing.assert_allclose(found.excess_k, room_of(2.5).excess_k)
    assert found.velocity_m_s.shape == one.velocity_m_s.shape
    assert found.outflow_excess_k.shape == one.outflow_excess_k.shape
