import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.result import Outcome
from core.room.closure import ConstantClosure
from core.room.march import MarchSettings, chunk_pairs, march
from core.room.room_grid import RoomGrid
from core.room.step import RoomModel, air_at_rest, longest_step_s, room_model
from core.room.wall_planes import Boundary, WallPlane, closed_room
from core.setting import SettingError


def slippery(wall: WallPlane) -> WallPlane:
    return eqx.tree_at(lambda w: w.no_slip, wall, jnp.float32(0.0))


def flat_room(cells: int, viscosity: float, walls_x: tuple, walls_z: tuple, buoyancy: float) -> RoomModel:
    """A unit square in x and z, two cells deep between free walls."""
    edge = 1.0 / cells
    grid = RoomGrid(cells=(cells, 2, cells), lower_m=(0.0, 0.0, 0.0), spacing_m=(edge, edge, edge))
    bare = closed_room(grid)
    x, y, z = bare.walls
    boundary = Boundary(
        (
            (walls_x[0](x[0]), walls_x[1](x[1])),
            (slippery(y[0]), slippery(y[1])),
            (walls_z[0](z[0]), walls_z[1](z[1])),
        )
    )
    closure = ConstantClosure(jnp.float32(0.0), jnp.float32(viscosity))
    return room_model(grid, boundary, closure, buoyancy_m_s2_k=buoyancy, molecular_m2_s=viscosity)


def as_it_is(wall: WallPlane) -> WallPlane:
    return wall


def cavity_nusselt(rayleigh: float, cells: int) -> float:
    """Mean Nusselt number of de Vahl Davis' cavity, in free-fall units (L = dT = g beta = 1)."""
    diffusivity = 1.0 / np.sqrt(rayleigh * 0.71)

    def at(excess_k: float):
        return lambda wall: eqx.tree_at(
            lambda w: (w.conductance_m_s, w.wall_excess_k),
            wall,
            tuple(jnp.full(wall.normal_m_s.shape, v) for v in (2.0 * cells * diffusivity, excess_k)),
        )

    model = flat_room(cells, 0.71 * diffusivity, (at(0.5), at(-0.5)), (as_it_is, as_it_is), 1.0)
    x_m = model.grid.centres_m(0)
    excess_k = jnp.asarray(np.broadcast_to((0.5 - x_m)[:, None, None], model.grid.cells), jnp.float32)
    end = march(
        air_at_rest(model, excess_k, 0.1),
        model,
        MarchSettings(longest_s=40.0, window_s=4.0, tolerance=1e-3, level_ahead_s=0.0),
    )
    assert end.outcome is Outcome.converged
    return float(jnp.mean(0.5 - end.last.excess_k[0])) * 2 * cells


def test_heated_cavity_carries_de_vahl_davis_heat():
    coarse, fine = cavity_nusselt(1e4, 12), cavity_nusselt(1e4, 24)

    # Second order: the limit of zero spacing from two grids. De Vahl Davis (1983): 2.243.
    assert fine + (fine - coarse) / 3.0 == pytest.approx(2.243, rel=0.01)


def test_lid_driven_cavity_has_the_published_centre_line():
    def moving(wall: WallPlane) -> WallPlane:
        return eqx.tree_at(lambda w: w.tangent_m_s[0], wall, jnp.ones_like(wall.normal_m_s))

    model = flat_room(32, 0.01, (as_it_is, as_it_is), (as_it_is, moving), 0.0)
    end = march(
        air_at_rest(model, jnp.zeros(model.grid.cells), 0.1),
        model,
        MarchSettings(longest_s=20.0, window_s=4.0, tolerance=2e-3, level_ahead_s=0.0),
    )

    # Ghia, Ghia and Shin (1982), Re 100: u on the vertical centre line, in lid speeds.
    heights = [0.1016, 0.2813, 0.4531, 0.6172, 0.7344, 0.9531]
    published = [-0.06434, -0.15662, -0.21090, -0.13641, 0.00332, 0.68717]
    centre = np.asarray(end.last.velocity[0])[16, 0]
    found = np.interp(heights, model.grid.centres_m(2), centre)
    assert found == pytest.approx(np.array(published), abs=0.02)


@pytest.mark.parametrize(("left_s", "stable_s"), [(5.0, 0.031), (5.0, 0.125), (5.0, 9.0), (0.4, 0.3)])
def test_what_is_left_of_a_window_is_divided_in_equal_stable_steps(left_s: float, stable_s: float):
    whole_s, steps = left_s, []
    while left_s > 1e-9:
        pairs, dt_s = chunk_pairs(left_s, stable_s, 20)
        assert 1 <= pairs <= 20
        steps += [dt_s] * 2 * pairs
        left_s -= 2 * pairs * dt_s

    assert sum(steps) == pytest.approx(whole_s, rel=1e-9)
    assert max(steps) <= stable_s * (1 + 1e-5)
    # No more than whole pairs, and equal chunks, ask for.
    assert len(steps) <= whole_s / stable_s + 2 * (1 + whole_s / (40 * stable_s))


def test_the_step_keeps_positive_weights_where_air_hardly_moves():
    model = flat_room(8, 1e-2, (as_it_is, as_it_is), (as_it_is, as_it_is), 0.0)
    still = air_at_rest(model, jnp.zeros(model.grid.cells), 0.0)
    viscosity = model.viscosity(still)
    diffusive = max(float(viscosity.cells_m2_s.max()), float(model.diffusivity_m2_s(viscosity).max()))

    own = 2.0 * float(longest_step_s(still, model, 0.45)) * diffusive
    assert own * sum(1.0 / h**2 for h in model.grid.spacing_m) == pytest.approx(1.0, rel=1e-3)


def test_a_lid_over_air_at_rest_limits_the_step():
    def moving(wall: WallPlane) -> WallPlane:
        return eqx.tree_at(lambda w: w.tangent_m_s[0], wall, 2.0 * jnp.ones_like(wall.normal_m_s))

    model = flat_room(8, 1e-4, (as_it_is, as_it_is), (as_it_is, moving), 0.0)
    still = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)

    # 2 m/s over cells of 1/8 m at a Courant number of 0.45: 28 ms; without the lid diffusion would allow 26 s.
    assert 0.02 < float(longest_step_s(still, model, 0.45)) <= 0.45 / 16


def test_a_march_that_diverges_ends_with_the_last_good_state():
    model = flat_room(8, 0.01, (as_it_is, as_it_is), (as_it_is, as_it_is), 1.0)
    start = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)
    broken = eqx.tree_at(lambda m: m.buoyancy_m_s2_k, model, jnp.float32(jnp.nan))

    end = march(start, broken, MarchSettings(longest_s=10.0))

    assert end.outcome is Outcome.nonfinite
    assert bool(jnp.all(jnp.isfinite(end.last.velocity[2])))


def test_an_unstable_courant_number_is_refused():
    with pytest.raises(SettingError, match="stable from 0 to"):
        MarchSettings(courant=0.9)


def test_a_march_begins_no_window_after_its_most_steps():
    model = flat_room(8, 0.01, (as_it_is, as_it_is), (as_it_is, as_it_is), 1.0)
    warm = jnp.broadcast_to(jnp.linspace(1.0, 0.0, 8)[:, None, None], model.grid.cells)
    start = air_at_rest(model, warm, 0.1)

    settings = MarchSettings(longest_s=10.0, window_s=1.0, tolerance=0.0, level_ahead_s=0.0, most_steps=100)
    end = march(start, model, settings)

    # Windows of at least forty steps: the third is the last.
    assert 100 <= end.steps <= 100 + 40
    assert end.model_s < 10.0
    assert end.outcome is Outcome.step_limit
