import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.room.pressure import divergence_per_s, pressure_solver, project
from core.room.room_grid import RoomGrid

GRID = RoomGrid(cells=(6, 5, 7), lower_m=(0.0, 0.0, 0.0), spacing_m=(0.1, 0.2, 0.15))


def test_projection_leaves_no_divergence_and_keeps_the_walls():
    u, v, w = (
        jax.random.normal(jax.random.key(a), [n + (a == b) for b, n in enumerate(GRID.cells)])
        for a in range(3)
    )
    # As much must flow out as flows in.
    u = u.at[-1].add((u[0].sum() - u[-1].sum()) / u[0].size)
    v = v.at[:, 0].set(0.0).at[:, -1].set(0.0)
    w = w.at[..., 0].set(0.0).at[..., -1].set(0.0)

    after, _ = project((u, v, w), jnp.float32(0.1), GRID, pressure_solver(GRID))

    before = float(jnp.abs(divergence_per_s((u, v, w), GRID)).max())
    # Float32 matrix products of length 7: a few units of the last place.
    assert float(jnp.abs(divergence_per_s(after, GRID)).max()) < 1e-5 * before
    assert np.array_equal(after[0][0], u[0])


def test_a_cosine_is_its_own_pressure():
    nx = GRID.cells[0]
    wave = np.cos(np.pi * 2 * (np.arange(nx) + 0.5) / nx)
    eigenvalue = (2 * np.cos(np.pi * 2 / nx) - 2) / GRID.spacing_m[0] ** 2
    source = jnp.asarray(np.broadcast_to(wave[:, None, None], GRID.cells), jnp.float32)

    pressure = pressure_solver(GRID).solve(source)

    assert np.asarray(pressure) == pytest.approx(np.asarray(source) / eigenvalue, abs=1e-6)
