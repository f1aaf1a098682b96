"""`draft` with several views: what varies along one of them is seen by another, and no view makes it worse."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.known_temperature import KnownTemperature, VertexGrid
from core.motion import CameraMotion
from core.problem import Problem, ShiftMeasurement
from core.rays.operator import build
from core.result import Solution
from core.scene import FixedTexture, Outlet, Patch, Scene, SolveModel, View
from core.solve.draft.draft import draft_grid, solve_draft
from core.solve.draft.temperature_system import AirPart, System
from core.view_frame import turn_to

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.7))
NOISE_PX = 2e-6


def eye(wall) -> View:
    turn = turn_to(wall)
    facing_it = turn.box(ROOM)
    x, _, z = facing_it.centre_m
    camera = looking_along_y(
        position_m=(x, facing_it.upper_m[1] - 20.0, z), width_px=160, height_px=160, focal_px=700.0
    )
    return View(name=wall, wall=wall, camera=turn.back().optics(camera), drift_std_px=0.0)


SCENE = Scene(
    room=ROOM,
    views=tuple(eye(wall) for wall in ("y_max", "x_max", "z_max")),
    light=FixedTexture(),
    boundary=(
        Outlet(
            patch=Patch(wall="z_max", lower_m=(1.0, 1.0), upper_m=(2.0, 2.0)),
            mean_temperature_k=293.25,
            temperature_std_k=0.1,
        ),
    ),
    solve=SolveModel(grid=20),
)


def warmth_k(x, y, z):
    """A column of warm air off the middle, wider above."""
    wide = 0.3 + 0.15 * z
    return np.exp(-((x - 2.6) ** 2 + (y - 0.9) ** 2) / (2 * wide**2)) * (0.6 + 0.2 * z)


@pytest.fixture(scope="module")
def shifts() -> tuple[ShiftMeasurement, ...]:
    """Through finer vertices than the solver's, with noise."""
    grid = VertexGrid(ROOM, (49, 37, 33))
    excess = SCENE.air.excess_refractivity(
        jnp.asarray(warmth_k(*np.meshgrid(*grid.axes_m, indexing="ij")), jnp.float32)
    )
    random, found = np.random.default_rng(5), []
    places = np.arange(6.0, 160.0, 6.0)
    for view in range(3):
        centres = np.stack(np.meshgrid(places, places), -1).reshape(-1, 2)
        operator = build(SCENE, view, centres, grid.shape, 6.0)
        seen = np.abs(np.asarray(operator.px_per_m)).sum((1, 2)) > 0
        shift = np.asarray(operator.apply(excess), np.float64)[seen]
        information = np.broadcast_to(np.eye(2) / NOISE_PX**2, (seen.sum(), 2, 2)).copy()
        found.append(
            ShiftMeasurement(
                centres[seen], shift + NOISE_PX * random.standard_normal(shift.shape), information, 6
            )
        )
    return tuple(found)


def errors_k(solution: Solution) -> tuple[float, float]:
    """Of the air, and of its mean along x, less the mean over the room at each height."""
    x, y, z = np.meshgrid(solution.x_m, solution.y_m, solution.z_m, indexing="ij")
    error = solution.temperature_k - warmth_k(x, y, z)
    error = error - error.mean((0, 1))
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(error.mean(0) ** 2)))


def test_a_second_view_finds_what_varies_along_the_first_and_a_third_does_no_harm(shifts):
    found = [
        errors_k(solve_draft(Problem(replace(SCENE, views=SCENE.views[:n]), shifts[:n]))) for n in (1, 2, 3)
    ]
    (one, along_one), (two, along_two), (three, _) = found
    assert three < two < 0.9 * one
    # The view along x sees where along y the column stands.
    assert along_two < 0.7 * along_one


def test_a_single_view_of_a_side_wall_finds_what_it_sees(shifts):
    """The dense part of the preconditioner is along y, and this view looks along x: the answer is the same."""
    side = solve_draft(Problem(replace(SCENE, views=SCENE.views[1:2]), shifts[1:2]))
    back = solve_draft(Problem(replace(SCENE, views=SCENE.views[:1]), shifts[:1]))
    assert side.outcome.name == "converged"
    assert errors_k(side)[1] < 0.6 * errors_k(back)[1]


def test_a_view_that_sees_nothing_but_noise_adds_hardly_any(shifts):
    """Air that the view along x sees well, beside a view along y whose noise is as large as what the other sees."""
    back, side = shifts[:2]
    size_px = float(np.sqrt(np.mean(side.displacement_px**2)))
    drawn = np.random.default_rng(1).standard_normal(back.displacement_px.shape)
    noisy = replace(
        back,
        displacement_px=size_px * drawn,
        information_per_px2=np.broadcast_to(np.eye(2) / size_px**2, (len(drawn), 2, 2)).copy(),
    )
    alone = solve_draft(Problem(replace(SCENE, views=SCENE.views[1:2]), (side,)))
    both = solve_draft(Problem(replace(SCENE, views=SCENE.views[:2]), (noisy, side)))
    assert errors_k(both)[0] < 1.05 * errors_k(alone)[0]


def test_a_motion_that_was_read_wrongly_makes_the_air_no_larger(shifts):
    """A view along x that moved by ten times its signal, where the motion is claimed to be known to its noise."""
    back, side = shifts[:2]
    known = CameraMotion(SCENE.views[1].camera, NOISE_PX * np.eye(6))
    size_px = float(np.sqrt(np.mean(side.displacement_px**2)))
    read = replace(side, motion=known)
    wrong = replace(read, displacement_px=side.displacement_px + np.array([10.0 * size_px, 0.0]))
    rightly, wrongly = (
        solve_draft(Problem(replace(SCENE, views=SCENE.views[:2]), (back, view))) for view in (read, wrong)
    )
    assert np.ptp(wrongly.temperature_std_k) == pytest.approx(np.ptp(rightly.temperature_std_k), rel=0.3)


def test_the_prior_is_that_of_steps_between_vertices():
    """Waves of the cosine transform and differences between vertices say the same of one part."""
    grid = VertexGrid(ROOM, (5, 4, 6))
    part = AirPart(2.0, (3.0, 5.0, 7.0))
    known = KnownTemperature(np.zeros(grid.shape, bool), np.zeros(grid.shape), np.ones(grid.shape), ())
    system = System(grid, (), (), (), (), known, 1.0, (part,), {}, 11.0)
    n = np.random.default_rng(0).standard_normal(grid.shape)
    profile = n.mean((0, 1), keepdims=True) + np.zeros_like(n)
    apart = n - profile
    steps = sum(f * np.sum(np.diff(apart, axis=axis) ** 2) for axis, f in enumerate(part.stiffness))
    assert np.sum(apart * system.smooth(apart)) == pytest.approx(part.mass * np.sum(apart**2) + steps)
    # A profile costs its steps alone, and not its level.
    assert np.sum(profile * system.smooth(profile)) == pytest.approx(
        11.0 * np.sum(np.diff(profile[0, 0]) ** 2)
    )
    assert np.abs(np.sum(profile * system.smooth(apart))) < 1e-9
    # Of two alike parts the sum may be twice as large in the square.
    assert replace(system, parts=(part, part)).smooth(apart) == pytest.approx(system.smooth(apart) / 2)


def test_cells_are_as_fine_along_an_axis_as_some_view_sees_it():
    one, two = (draft_grid(replace(SCENE, views=SCENE.views[:n])) for n in (1, 2))
    side = draft_grid(replace(SCENE, views=SCENE.views[1:2]))
    assert (one.shape[0], two.shape[0], two.shape[1]) == (21, 21, 16)
    assert one.shape[1] == 9
    assert side.shape[0] == 9
    assert side.shape[1] == 16


def test_windows_on_something_that_moved_leave_the_answer_as_it_is(shifts):
    """They moved by ten times the usual shift, as a plume may: but nothing near them shows half of that."""
    problem = Problem(SCENE, shifts)
    ceiling = shifts[2]
    on_it = np.all(np.abs(ceiling.centres_px - (60.0, 100.0)) < 9.0, axis=1)
    assert 4 <= on_it.sum() <= 9
    size = np.linalg.norm(ceiling.displacement_px, axis=1)
    usual = np.sqrt(np.mean(np.minimum(size, np.percentile(size, 90)) ** 2))
    spoilt = replace(
        ceiling, displacement_px=np.where(on_it[:, None], (10.0 * usual, 0.0), ceiling.displacement_px)
    )

    found = solve_draft(Problem(SCENE, (*shifts[:2], spoilt)))
    without = solve_draft(problem)

    apart = np.abs(found.temperature_k - without.temperature_k)
    # So many windows fewer say a little less.
    assert apart.max() < 0.1 * np.ptp(without.temperature_k)
    total = sum(len(shift.centres_px) for shift in shifts)
    assert any(note.startswith(f"{on_it.sum()} of {total} windows") for note in found.notes)
    assert not any("no air has" in note for note in without.notes)
