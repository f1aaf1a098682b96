import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.result import Outcome
from core.room.closure import ConstantClosure
from core.room.march import MarchSettings, MarchState, march, window
from core.room.pace import step_limits
from core.room.room_grid import RoomGrid
from core.room.step import RoomModel, air_at_rest, own_pace, room_model
from core.room.wall_planes import Boundary, WallPlane, closed_room
from core.setting import SettingError

LIMITS = step_limits(0.45, 1e9, steady=True)


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


@pytest.mark.parametrize("steady", [True, False])
@pytest.mark.parametrize("window_s", [0.05, 1.0, 7.0])
def test_a_march_lives_through_its_windows_and_no_longer(window_s: float, steady: bool):
    model = flat_room(8, 0.01, (as_it_is, as_it_is), (as_it_is, as_it_is), 1.0)
    warm = jnp.broadcast_to(jnp.linspace(1.0, 0.0, 8)[:, None, None], model.grid.cells)
    settings = MarchSettings(
        longest_s=2 * window_s,
        window_s=window_s,
        tolerance=0.0,
        level_ahead_s=0.0,
        chunk_steps=4,
        steady=steady,
    )
    state = MarchState(air_at_rest(model, warm, 0.1), courant=0.45)

    _, _, lived_s, steps = window(state.flow, model, settings, state, lambda: None)

    assert float(lived_s.mean()) == pytest.approx(window_s, rel=1e-3)
    assert steps >= 8
    if not steady:
        assert np.ptp(np.asarray(lived_s)) == pytest.approx(0.0, abs=1e-5 * window_s)


def test_slow_air_takes_longer_steps_to_the_same_steady_state():
    def moving(wall: WallPlane) -> WallPlane:
        return eqx.tree_at(lambda w: w.tangent_m_s[0], wall, jnp.ones_like(wall.normal_m_s))

    model = flat_room(16, 0.02, (as_it_is, as_it_is), (as_it_is, moving), 0.0)
    start = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)
    ends = [
        march(start, model, MarchSettings(longest_s=40.0, window_s=2.0, tolerance=1e-5, steady=steady))
        for steady in (True, False)
    ]

    assert ends[0].outcome is ends[1].outcome is Outcome.converged
    assert ends[0].steps < 0.6 * ends[1].steps
    for own, true in zip(ends[0].last.velocity, ends[1].last.velocity, strict=True):
        np.testing.assert_allclose(own, true, atol=3e-4)


def test_stratified_air_that_swings_comes_to_rest_sooner():
    model = flat_room(16, 1e-5, (slippery, slippery), (slippery, slippery), 1.0)
    height_m, along_m = model.grid.centres_m(2), model.grid.centres_m(0)
    tilted = height_m[None, None, :] + 0.05 * np.cos(np.pi * along_m)[:, None, None]
    start = air_at_rest(model, jnp.asarray(np.broadcast_to(tilted, model.grid.cells), jnp.float32), 0.0)

    def speed(*, steady: bool) -> float:
        settings = MarchSettings(
            longest_s=20.0, window_s=2.0, tolerance=0.0, level_ahead_s=0.0, steady=steady
        )
        return max(float(jnp.abs(of).max()) for of in march(start, model, settings).last.velocity)

    assert speed(steady=True) < 0.4 * speed(steady=False)


def test_air_that_swings_on_is_unsteady_and_its_mean_is_over_many_windows():
    model = flat_room(16, 1e-5, (slippery, slippery), (slippery, slippery), 1.0)
    height_m, along_m = model.grid.centres_m(2), model.grid.centres_m(0)
    tilted = height_m[None, None, :] + 0.05 * np.cos(np.pi * along_m)[:, None, None]
    start = air_at_rest(model, jnp.asarray(np.broadcast_to(tilted, model.grid.cells), jnp.float32), 0.0)

    end = march(
        start,
        model,
        MarchSettings(longest_s=30.0, window_s=2.0, tolerance=0.0, level_ahead_s=0.0, steady=False),
    )

    assert end.outcome is Outcome.unsteady
    assert end.mean_windows > 5
    fastest = [max(float(jnp.abs(of).max()) for of in flow.velocity) for flow in (end.mean, end.last)]
    assert fastest[0] < 0.5 * fastest[1]


def test_the_step_keeps_positive_weights_where_air_hardly_moves():
    model = flat_room(8, 1e-2, (as_it_is, as_it_is), (as_it_is, as_it_is), 0.0)
    still = air_at_rest(model, jnp.zeros(model.grid.cells), 0.0)
    viscosity = model.viscosity(still)
    diffusive = max(float(viscosity.cells_m2_s.max()), float(model.diffusivity_m2_s(viscosity).max()))

    own = 2.0 * float(own_pace(still, model, LIMITS).shortest_s) * diffusive
    assert own * sum(1.0 / h**2 for h in model.grid.spacing_m) == pytest.approx(1.0, rel=1e-3)


def test_a_lid_over_air_at_rest_limits_the_step():
    def moving(wall: WallPlane) -> WallPlane:
        return eqx.tree_at(lambda w: w.tangent_m_s[0], wall, 2.0 * jnp.ones_like(wall.normal_m_s))

    model = flat_room(8, 1e-4, (as_it_is, as_it_is), (as_it_is, moving), 0.0)
    still = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)

    # 2 m/s over cells of 1/8 m at a Courant number of 0.45: 28 ms; without the lid diffusion would allow 26 s.
    assert 0.02 < float(own_pace(still, model, LIMITS).shortest_s) <= 0.45 / 16


def test_a_march_that_diverges_ends_with_the_last_good_state():
    model = flat_room(8, 0.01, (as_it_is, as_it_is), (as_it_is, as_it_is), 1.0)
    start = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)
    broken = eqx.tree_at(lambda m: m.buoyancy_m_s2_k, model, jnp.float32(jnp.nan))

    end = march(start, broken, MarchSettings(longest_s=10.0, window_s=5.0))

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

    # Windows of at least forty steps: the third is the last, and it differs from the second.
    assert 100 <= end.steps <= 100 + 40
    assert end.model_s < 10.0
    assert end.outcome is Outcome.step_limit


def test_a_march_that_changes_little_at_its_longest_time_has_converged():
    def moving(wall: WallPlane) -> WallPlane:
        return eqx.tree_at(lambda w: w.tangent_m_s[0], wall, jnp.ones_like(wall.normal_m_s))

    model = flat_room(8, 0.02, (as_it_is, as_it_is), (as_it_is, moving), 0.0)
    start = air_at_rest(model, jnp.zeros(model.grid.cells), 0.1)

    def ended(longest_s: float) -> Outcome:
        return march(start, model, MarchSettings(longest_s=longest_s, window_s=1.0, tolerance=0.0)).outcome

    assert ended(2.0) is Outcome.unsteady
    assert ended(20.0) is Outcome.converged
