"""How many of a march's last windows its mean is taken over."""

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Float

from core.room.step import Flow
from core.room.unrest import settled_windows

CELLS, WINDOWS = (4, 4, 4), 12


def windows(
    velocity_m_s: Float[np.ndarray, "windows values"], excess_k: Float[np.ndarray, "windows values"]
) -> list[Flow]:
    def flow(speeds: Float[np.ndarray, " values"], kelvins: Float[np.ndarray, " values"]) -> Flow:
        along = jnp.asarray(speeds.reshape(CELLS), jnp.float32)
        still = jnp.zeros(CELLS)
        return Flow((along, still, still), jnp.asarray(kelvins.reshape(CELLS), jnp.float32), still, None)

    return [flow(*pair) for pair in zip(velocity_m_s, excess_k, strict=True)]


def chance(seed: int) -> Float[np.ndarray, "windows values"]:
    return np.random.default_rng(seed).normal(1.0, 0.1, (WINDOWS, 64))


def decay(left: float) -> Float[np.ndarray, "windows values"]:
    """Fields that come nearer to their end by the same share in each window."""
    return 1.0 + left ** np.arange(WINDOWS)[:, None] * np.linspace(0.5, 1.0, 64)


def test_windows_that_differ_by_chance_all_count():
    assert settled_windows(windows(chance(1), chance(2))) == WINDOWS


def test_of_a_room_that_comes_to_rest_the_last_two_count():
    assert settled_windows(windows(decay(0.5), decay(0.7))) == 2


@pytest.mark.parametrize("field", ["velocity", "temperature"])
def test_a_beginning_that_is_not_yet_the_room_does_not_count(field: str):
    starts = chance(1) + 3.0 * (np.arange(WINDOWS) < 4)[:, None]
    both = (starts, chance(2)) if field == "velocity" else (chance(2), starts)

    assert settled_windows(windows(*both)) == WINDOWS - 4


def test_small_changes_of_warm_air_are_not_lost_in_rounding():
    assert settled_windows(windows(chance(1), 1000.0 + 0.01 * chance(2))) == WINDOWS


def test_two_windows_are_the_least_that_tell_a_variance():
    assert [settled_windows(windows(chance(1), chance(2))[:n]) for n in (1, 2, 3)] == [1, 2, 3]
