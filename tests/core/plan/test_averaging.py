"""How long to average: against drawn processes, and against a stirred gradient worked out by hand."""

import jax.numpy as jnp
import numpy as np
import pytest

from core.plan.averaging import Fluctuation, fluctuation
from core.plan.verdicts import moving
from core.room.k_epsilon import KEpsilonState
from core.room.room_grid import RoomGrid
from core.room.step import Flow

GRID = RoomGrid(cells=(8, 6, 4), lower_m=(0.0, 0.0, 0.0), spacing_m=(0.5, 0.5, 0.5))
ENERGY, DECAY, SPEED, SLOPE = 0.01, 0.004, 0.2, 1.5


def stirred(*, turbulent: bool = True, slope=SLOPE, decay=DECAY) -> Flow:
    """Air that blows along x at SPEED through a temperature that rises along z."""
    speed = [
        np.full([n + (a == axis) for a, n in enumerate(GRID.cells)], SPEED * (axis == 0)) for axis in range(3)
    ]
    rising_k = np.broadcast_to(slope * 0.5 * np.arange(4), GRID.cells)
    turbulence = (
        KEpsilonState(jnp.full(GRID.cells, ENERGY), jnp.full(GRID.cells, decay)) if turbulent else None
    )
    return Flow(
        tuple(jnp.asarray(one, jnp.float32) for one in speed),
        jnp.asarray(rising_k, jnp.float32),
        jnp.zeros(GRID.cells),
        turbulence,
    )


@pytest.mark.parametrize("averaged_s", [0.5, 4.0, 20.0, 200.0])
def test_a_mean_of_drawn_air_errs_by_as_much_as_is_said(averaged_s):
    random, tau_s, step_s, std_k = np.random.default_rng(0), 4.0, 0.1, 0.2
    steps, draws = int(averaged_s / step_s), 4000
    keeps = np.exp(-step_s / tau_s)
    now = std_k * random.standard_normal(draws)
    total = np.zeros(draws)
    for _ in range(steps):
        after = keeps * now + std_k * (1 - keeps**2) ** 0.5 * random.standard_normal(draws)
        total += 0.5 * (now + after)
        now = after
    assert Fluctuation(std_k, tau_s).error_k(averaged_s) == pytest.approx((total / steps).std(), rel=0.05)


def test_as_long_as_is_said_gives_the_error_that_was_wished():
    air = Fluctuation(0.2, 4.0)
    for error_k in (0.19, 0.1, 0.02):
        assert air.error_k(air.seconds_for(error_k)) == pytest.approx(error_k, rel=1e-6)
    assert air.seconds_for(0.001) == pytest.approx(4 * air.seconds_for(0.002), rel=0.01)
    assert air.seconds_for(0.3) == 0.0


def test_a_stirred_gradient_fluctuates_as_worked_out_by_hand():
    found = fluctuation(stirred(), GRID)
    length_m = ENERGY**1.5 / DECAY
    assert found.std_k == pytest.approx((0.09 / 0.85) ** 0.5 * length_m * SLOPE, rel=1e-4)
    assert found.time_s == pytest.approx(0.43 * length_m / (SPEED**2 + 2 / 3 * ENERGY) ** 0.5, rel=1e-4)


def test_no_eddy_is_longer_than_the_room_is_wide():
    calm = fluctuation(stirred(decay=1e-9), GRID)
    assert calm.std_k == pytest.approx((0.09 / 0.85) ** 0.5 * 2.0 * SLOPE, rel=1e-4)


def test_beside_an_object_its_own_temperature_is_no_gradient():
    flow, air = stirred(slope=0.0), np.ones(GRID.cells, bool)
    air[2:4, 2:4, :2] = False
    hot = Flow(flow.velocity, jnp.where(air, flow.excess_k, 30.0), flow.pressure_m2_s2, flow.turbulence)
    assert fluctuation(hot, GRID, air) is None
    assert fluctuation(hot, GRID) is not None


def test_air_that_is_alike_or_has_no_turbulence_says_nothing():
    assert fluctuation(stirred(slope=0.0), GRID) is None
    assert fluctuation(stirred(turbulent=False), GRID) is None
    assert moving(None) == []


def test_a_verdict_tells_three_errors_and_the_time_for_each():
    (said,) = moving(Fluctuation(0.19, 4.5))
    assert "to 0.1 K, 27 s; to 0.05 K, 2.1 min; to 0.02 K, 13 min" in said
    (long,) = moving(Fluctuation(1.0, 60.0))
    assert "to 0.1 K, 3.3 h" in long
