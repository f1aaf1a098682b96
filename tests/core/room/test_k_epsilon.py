"""The k-epsilon model where hardly anything feeds turbulence."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.room.k_epsilon import C_MU, KAPPA, KEpsilonState, advance, largest_eddy_m
from core.room.room_grid import AXES, RoomGrid
from core.room.wall_planes import closed_room

GRID = RoomGrid(cells=(10, 8, 12), lower_m=(0.0, 0.0, 0.0), spacing_m=(0.3, 0.3, 0.25))
STILL = tuple(jnp.zeros([n + (a == b) for b, n in enumerate(GRID.cells)]) for a in AXES)


def after(energy: float, dissipation: float, steps: int) -> KEpsilonState:
    state = KEpsilonState(jnp.full(GRID.cells, energy), jnp.full(GRID.cells, dissipation))
    for _ in range(steps):
        state = advance(
            state,
            STILL,
            closed_room(GRID),
            GRID,
            jnp.full(GRID.cells, 0.1),
            jnp.float32(1.5e-5),
            jnp.float32(1.0),
        )
    return state


def test_no_eddy_is_larger_than_the_room_allows():
    state = after(1e-3, 1e-8, 5)

    # 2.4 m, 2.4 m and 3 m: the log law's length in the middle of the nearest walls.
    assert float(largest_eddy_m(closed_room(GRID), GRID)) == pytest.approx(KAPPA * 1.2)
    largest = C_MU**0.25 * jnp.sqrt(state.energy_m2_s2) * float(largest_eddy_m(closed_room(GRID), GRID))
    inner = np.s_[1:-1, 1:-1, 1:-1]
    assert np.all(np.asarray(state.eddy_m2_s() / largest)[inner] < 1.001)
    # Without that the eddy viscosity would be C k^2 / eps, 9 m2/s.
    assert float(state.eddy_m2_s()[inner].max()) < 0.01


def test_smaller_eddies_decay_as_if_there_were_no_walls():
    state, inner = after(1e-3, 1e-4, 1), np.s_[4:6, 3:5, 5:7]

    # One implicit step: k and epsilon fall by their own rates, whatever the room's size.
    assert np.asarray(state.energy_m2_s2[inner]) == pytest.approx(1e-3 / 1.01, rel=1e-4)
    assert np.asarray(state.dissipation_m2_s3[inner]) == pytest.approx(1e-4 / (1 + 1.92 * 0.01), rel=1e-4)


def test_free_surfaces_do_not_make_eddies_small():
    free = eqx.tree_at(lambda b: [w.no_slip for w in b.walls[1]], closed_room(GRID), [jnp.float32(0.0)] * 2)
    flat = RoomGrid(cells=(10, 2, 12), lower_m=(0.0, 0.0, 0.0), spacing_m=(0.3, 0.1, 0.25))

    # 3 m and 3 m between walls; the 0.2 m between free surfaces do not count.
    assert float(largest_eddy_m(free, flat)) == pytest.approx(KAPPA * 1.5)
