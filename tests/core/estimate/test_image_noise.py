"""The noise of shifts, from their own curl."""

from dataclasses import replace

import numpy as np
import pytest

from core.estimate.image_noise import NOISE_KNOWN, images
from core.estimate.observation import IMAGES, Observations, observations
from tests.core.estimate.test_explained import VERTICES, room_of, seen


def stated_at(noise: float, power: float, seed: int) -> Observations:
    """Pictures whose noise has `power` times the variance that is stated."""
    given = seen(4.0, noise, seed, window_px=2)
    shift = given.shifts[0]
    stated = replace(shift, information_per_px2=power * shift.information_per_px2)
    return observations(replace(given, shifts=(stated,)), VERTICES)


def factor_of(data: Observations, warmer_k: float) -> tuple[float, float]:
    found = images(data, room_of(warmer_k))
    _, variance, group = data.values()
    return float(found.variance_px2.sum() / variance[group == IMAGES].sum()), found.known


@pytest.mark.parametrize("power", [0.5, 1.0, 1.5])
def test_noise_that_is_misstated_is_found_without_the_air(power: float):
    found = [factor_of(stated_at(1.0, power, seed), 0.0) for seed in range(6)]

    known = found[0][1]
    assert known < 0.5 * NOISE_KNOWN
    # The stated variance keeps the weight that its own doubt gives it.
    stated = (known / NOISE_KNOWN) ** 2
    expected = power ** (1.0 - stated)
    assert np.mean([factor for factor, _ in found]) == pytest.approx(expected, rel=2.0 * known)


def test_air_that_nothing_explains_is_not_taken_for_noise():
    strong = stated_at(0.05, 1.0, 0)

    factor, known = factor_of(strong, 0.0)
    assert factor == pytest.approx(1.0, abs=3.0 * known)
