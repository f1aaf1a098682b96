import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.room.room_grid import RoomGrid, closed, face_mean
from core.room.transport import limited_flux, scalar_rate
from core.room.wall_planes import closed_room

GRID = RoomGrid(cells=(8, 6, 7), lower_m=(0.0, 0.0, 0.0), spacing_m=(0.1, 0.2, 0.15))


def test_a_linear_field_has_exact_face_values():
    padded = jnp.arange(-2.0, 10.0)[:, None, None]

    flux = limited_flux(padded, jnp.full((9, 1, 1), 0.3), 0)

    # Second order: exact where the slope is constant.
    assert np.asarray(flux)[:, 0, 0] == pytest.approx(0.3 * (np.arange(-1, 8) + 0.5), rel=1e-6)


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_a_step_carried_along_stays_within_its_bounds(speed: float):
    field = jnp.where(jnp.arange(40) < 20, 1.0, 0.0)[:, None, None]
    for _ in range(20):
        flux = limited_flux(
            jnp.pad(field, [(2, 2), (0, 0), (0, 0)], mode="edge"), jnp.full((41, 1, 1), speed), 0
        )
        field = field - jnp.diff(flux, axis=0)

    assert float(field.min()) > -1e-6
    assert float(field.max()) < 1 + 1e-6
    # The front has moved 8 cells and is still steep: second order keeps it within 7 cells.
    middle = 20 + 20 * speed
    assert float(field[round(middle) - 4, 0, 0]) > 0.9
    assert float(field[round(middle) + 4, 0, 0]) < 0.1


def test_a_closed_room_keeps_its_heat():
    field = jax.random.uniform(jax.random.key(0), GRID.cells)
    u, v, w = (
        jnp.pad(
            jax.random.normal(jax.random.key(a), [n - (a == b) for b, n in enumerate(GRID.cells)]),
            [(1, 1) if a == b else (0, 0) for b in range(3)],
        )
        for a in range(3)
    )
    zero = tuple((low.inflow_excess_k, high.inflow_excess_k) for low, high in closed_room(GRID).walls)

    rate = scalar_rate(field, zero, (u, v, w), jnp.full(GRID.cells, 1e-2), closed_room(GRID), GRID)

    assert abs(float(rate.sum())) < 1e-4 * float(jnp.abs(rate).sum())


def test_a_closed_diffusivity_is_zero_on_walls_and_the_cells_between_them():
    cells = jax.random.uniform(jax.random.key(0), GRID.cells)

    sealed = closed(cells)

    assert np.array_equal(sealed[1:-1, 1:-1, 1:-1], cells)
    for axis in range(3):
        faces = np.asarray(face_mean(sealed, axis))
        beyond = faces.take([0, -1], axis=axis)
        assert not beyond.any()
