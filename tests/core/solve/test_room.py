import re
from dataclasses import replace
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from core.estimate.alternatives import explains_more, promising_closure, worth_large_eddies
from core.estimate.forward_runs import Derivatives, march_under, perturbed
from core.estimate.least_squares import Posterior
from core.estimate.marches import Marches
from core.estimate.observation import observations
from core.estimate.parameter_fit import Background, Fit, mean_fit, search
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import misfit_ratio
from core.estimate.posterior import Analysis, doubt_of_velocity, model_error_of, solution
from core.estimate.prior import Prior, room_prior
from core.geometry import Box, WallName, looking_along_y
from core.motion import CameraMotion
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.rays.operator import build
from core.result import Solution
from core.room.forward import Room, closure_name, room
from core.scene import FixedTexture, FlowModel, Heater, Inlet, Outlet, Patch, Scene, View, Wall
from core.solve.room import (
    RoomSettings,
    background_of,
    fitted_room,
    solve_room,
    with_large_eddies,
)
from core.view_frame import turn_to
from core.watch import Watch

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0))
SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(0.7, 1.1), upper_m=(1.3, 1.5)),
    temperature_k=303.15,
    velocity_m_s=(0.4, 0.0, 0.0),
)
SETTINGS = RoomSettings(
    cells=10, coarse_cells=8, vertices=12, settle_s=300.0, restart_s=90.0, restart_walls_s=90.0, refine_s=90.0
)
# Where it does not matter how far the air has settled.
SHORT = replace(SETTINGS, settle_s=60.0, restart_s=30.0, restart_walls_s=30.0, refine_s=30.0, rounds=2)


def telling(told: list[dict]) -> Marches:
    """Marches whose rows are put into a list."""
    return Marches(Watch(lambda row, growing: told.append(dict(row))))


def deviations(prior: Prior, row: dict) -> np.ndarray:
    """Told parameters in deviations from their priors."""
    std = np.asarray(ravel_pytree(prior.std)[0], float)[prior.active()]
    stated = by_name(prior, np.zeros(len(std)))
    moved = [np.log(row[name]) if "ratio" in name else row[name] - start for name, start in stated.items()]
    return np.array(moved) / std


def looking_at(wall: WallName) -> View:
    """A view of a wall, by a camera 7 m from the room."""
    turn = turn_to(wall)
    x_m, y_m, z_m = turn.point(ROOM.centre_m)
    camera = looking_along_y(position_m=(x_m, y_m - 9.0, z_m), width_px=200, height_px=200, focal_px=900.0)
    return View(name=wall, wall=wall, camera=turn.back().optics(camera))


def scene(supply: Inlet, flow: FlowModel = FlowModel(transport="given", viscosity_m2_s=2e-3)) -> Scene:
    return Scene(
        room=ROOM,
        views=(looking_at("y_max"),),
        light=FixedTexture(),
        flow=flow,
        boundary=(
            supply,
            Outlet(patch=Patch(wall="x_min", lower_m=(0.7, 0.1), upper_m=(1.3, 0.5))),
            Wall(wall="x_min", thermal="adiabatic"),
            Wall(wall="x_max", thermal="temperature", temperature_k=293.15),
            Wall(wall="y_min", thermal="temperature", temperature_k=293.15),
            Wall(wall="y_max", thermal="temperature", temperature_k=293.15),
            Wall(wall="z_min", thermal="adiabatic"),
            Wall(wall="z_max", thermal="adiabatic"),
        ),
    )


# The true room is marched on other cells than any that a fit uses, and traced on other vertices.
TRUE_CELLS, TRUE_VERTICES = 14, 17


def true_room(where: Scene, heat: float = 0.0) -> Solution:
    """One march of the room as it is; `heat` is in prior deviations of a heater's coefficient."""
    fine = room(where, TRUE_CELLS, closure_name(where))
    prior = room_prior(Problem(where, ()), fine.layout)
    vector = np.array([heat if name.startswith("heater_log_heat") else 0.0 for name in prior.names()])
    parameters = prior.parameters(vector)
    start = fine.at_rest(fine.model(parameters), np.zeros(fine.grid.cells[2]))
    run = march_under(fine, parameters, start, 300.0, (TRUE_VERTICES,) * 3, Marches())
    fields, axis_m = run.fields, np.linspace(0.0, 2.0, TRUE_VERTICES)
    kelvin = 293.15 + fields.excess_k
    return Solution(axis_m, axis_m, axis_m, kelvin, fields.pressure_m2_s2, fields.velocity_m_s)


@pytest.fixture(scope="module")
def truth() -> Solution:
    """The room as it is, by the solver itself with nothing to correct."""
    return solve_room(Problem(scene(SUPPLY), ()), SETTINGS)


def measured(where: Scene, truth: Solution, noise_px: float) -> Problem:
    """What the cameras and a plane of thermometers see of the truth, with the scene as entered."""
    centres = np.stack(np.meshgrid(np.arange(8.0, 200, 16), np.arange(8.0, 200, 16)), -1).reshape(-1, 2)
    excess = where.air.excess_refractivity(jnp.asarray(truth.temperature_k - 293.15, jnp.float32))
    information = np.broadcast_to(np.eye(2) / noise_px**2, (len(centres), 2, 2)).copy()
    noise = np.random.default_rng(1)

    def seen(view: int) -> ShiftMeasurement:
        operator = build(where, view, centres, truth.temperature_k.shape, 16.0)
        shift = np.asarray(eqx.filter_jit(lambda o, e: o.apply(e))(operator, excess))
        return ShiftMeasurement(centres, shift + noise_px * noise.normal(size=shift.shape), information, 16)

    plane = PlaneData(
        "x_min",
        truth.y_m,
        truth.z_m,
        np.asarray(truth.temperature_k[0], float),
        np.asarray(truth.pressure_m2_s2[0], float),
        np.asarray(truth.velocity_m_s[0], float),
    )
    return Problem(where, tuple(seen(view) for view in range(len(where.views))), (plane,))


def after_the_camera_moved(problem: Problem) -> Problem:
    """The same, after the mount moved the picture by far more than the air did."""
    (shift,) = problem.shifts
    motion = CameraMotion(problem.scene.views[0].camera, 5.0 * np.eye(6))
    step_px = motion.at(shift.centres_px) @ np.array([0.4, -1.0, 0.2, 0.7, -0.5, 0.8])
    moved = replace(shift, displacement_px=shift.displacement_px + step_px, motion=motion)
    return replace(problem, shifts=(moved,))


@pytest.mark.parametrize("moved", [False, True])
def test_images_repair_a_supply_that_was_entered_wrongly(moved: bool):
    wrong = replace(SUPPLY, temperature_k=305.15, velocity_m_s=(0.48, 0.0, 0.0))
    problem = measured(scene(wrong), true_room(scene(SUPPLY)), 1e-5)
    problem = after_the_camera_moved(problem) if moved else problem

    reported: list[dict] = []
    settings = replace(SETTINGS, cells=12, coarse_cells=9)
    found = solve_room(problem, settings, Watch(lambda row, growing: reported.append(row)))

    (supply,) = (event for event in reported if "supply_1_m_s" in event)
    excess_k, speed_m_s = supply["supply_1_excess_k"], supply["supply_1_m_s"]
    # Entered 12 K and 0.48 m/s; it has 10 K and 0.4 m/s. Twelve cells an edge find the temperature and the heat, and
    # make good a part of the speed only.
    assert excess_k == pytest.approx(10.0, abs=0.5)
    assert excess_k * speed_m_s == pytest.approx(4.0, rel=0.15)
    assert abs(speed_m_s - 0.4) < 0.75 * 0.08
    # The operator is told.
    assert any("than the 305.15 K entered" in note for note in found.notes)
    assert found.temperature_std_k.min() > 0
    assert found.informed.max() > 0.3


def test_windows_on_something_that_moved_are_told(truth: Solution):
    problem = measured(scene(SUPPLY), truth, 1e-5)
    (shift,) = problem.shifts
    on_it = np.all(np.abs(shift.centres_px - (104.0, 104.0)) < (9.0, 20.0), axis=1)
    by_px = np.where(on_it[:, None], (4.0, -0.3), shift.displacement_px)
    spoilt = replace(problem, shifts=(replace(shift, displacement_px=by_px),))

    without, found = solve_room(problem, SHORT), solve_room(spoilt, SHORT)

    assert not any("no air has" in note for note in without.notes)
    (told,) = (note for note in found.notes if "no air has" in note)
    assert told.startswith("3 of 144 windows (2.1 %) show a shift")
    # So few windows less say hardly anything else.
    apart_k = np.abs(found.temperature_k - without.temperature_k)
    assert apart_k.max() < 0.02 * np.ptp(without.temperature_k)


def test_derivatives_that_point_the_wrong_way_leave_a_room_no_worse_than_stated(truth: Solution):
    wrong = replace(SUPPLY, temperature_k=304.15, velocity_m_s=(0.44, 0.0, 0.0))
    problem = measured(scene(wrong), truth, 1e-5)
    background = background_of(problem, SETTINGS, Marches())
    data = observations(problem, (SETTINGS.vertices,) * 3)
    turned = eqx.tree_at(lambda d: d.apart, background.derivatives, -background.derivatives.apart)
    reported: list[dict] = []
    vector = np.zeros(len(background.prior.active()))
    settings = replace(SETTINGS, rounds=2)
    begun = Fit.begun(vector, background.first)
    best, _ = search(background.fine, background.prior, data, begun, turned, settings, telling(reported))

    assert max(event.get("misfit_left", 0.0) for event in reported) > 1.15
    assert misfit_ratio(data, best.room, background.first) <= 1.0


@pytest.fixture(scope="module")
def unknown_walls(truth: Solution) -> Background:
    """The room of which nobody stated the walls."""
    where = scene(SUPPLY)
    openings = tuple(part for part in where.boundary if not isinstance(part, Wall))
    return background_of(measured(replace(where, boundary=openings), truth, 1e-5), SETTINGS, Marches())


def test_derivatives_are_made_again_where_unknown_walls_have_moved(unknown_walls: Background):
    background = unknown_walls
    settings = replace(SETTINGS, rounds=3, renewals=1, jacobian_valid=0.0, fine_step=0.0)
    data = observations(background.problem, (settings.vertices,) * 3)
    moved_to: list[np.ndarray] = []
    reported: list[dict] = []
    over: list[np.ndarray] = []

    def renewed(vector: np.ndarray, spread: np.ndarray) -> Derivatives:
        moved_to.append(vector)
        over.append(spread)
        return background.derivatives

    begun = Fit.begun(np.zeros(len(background.prior.active())), background.first)
    search(
        background.fine,
        background.prior,
        data,
        begun,
        background.derivatives,
        settings,
        telling(reported),
        renewed,
    )

    rounds = [event for event in reported if "round" in event]
    assert len(moved_to) == 1
    # After the second round, from the room that was nearest to the data by then.
    kept = [event for event in rounds[:2] if event["misfit_left"] < 1.0][-1]
    np.testing.assert_allclose(moved_to[0], deviations(background.prior, kept), atol=1e-6)
    # The data have told every parameter more than the prior did.
    assert np.all((over[0] > 0.0) & (over[0] < 1.0))


def test_a_search_whose_derivatives_mislead_comes_back_and_learns(unknown_walls: Background):
    background = unknown_walls
    data = observations(background.problem, (SETTINGS.vertices,) * 3)
    turned = eqx.tree_at(lambda d: d.apart, background.derivatives, -background.derivatives.apart)
    reported: list[dict] = []
    settings = replace(SETTINGS, rounds=2, renewals=0, fine_step=0.0)
    begun = Fit.begun(np.zeros(len(background.prior.active())), background.first)
    best, _ = search(
        background.fine,
        background.prior,
        data,
        begun,
        turned,
        settings,
        telling(reported),
        lambda *_: turned,
    )

    rounds = [event for event in reported if "round" in event]
    first, second = (deviations(background.prior, event) for event in rounds)
    assert rounds[0]["misfit_left"] > 1.0
    # The second step starts from where the first did, is shorter, and does not go the same way again.
    assert np.abs(second).max() <= 0.5 * np.abs(first).max() + 1e-9
    assert np.dot(first, second) < 0.5 * np.dot(first, first)
    assert misfit_ratio(data, best.room, background.first) <= 1.0


def test_the_mean_of_two_rooms_that_err_to_either_side_has_their_mean_parameters(unknown_walls: Background):
    background = unknown_walls
    data = observations(background.problem, (SETTINGS.vertices,) * 3)
    first, prior = background.first, background.prior
    shown = data.predicted(first.fields).reshape(data.shifts[0].displacement_px.shape)
    of_first = eqx.tree_at(lambda d: d.shifts[0].displacement_px, data, shown)
    fits = [
        Fit(
            Posterior(
                side * np.ones(len(prior.active())), (2.0 + side) * np.eye(len(prior.active())), np.zeros(0)
            ),
            eqx.tree_at(lambda r: r.fields.excess_k, first, (1.0 + 0.2 * side) * first.fields.excess_k),
        )
        for side in (-1.0, 1.0)
    ]
    found = mean_fit(fits, fits[1], prior, of_first)

    np.testing.assert_allclose(found.posterior.vector, 0.0, atol=0.05)
    np.testing.assert_allclose(found.room.fields.excess_k, first.fields.excess_k, atol=0.05)
    # How far to believe it, and the march, are those of the best one.
    np.testing.assert_array_equal(found.posterior.covariance, fits[1].posterior.covariance)
    assert found.room.flow is fits[1].room.flow


@pytest.fixture(scope="module")
def under_k_epsilon(truth: Solution) -> tuple[Analysis, Room]:
    """A fitted room and its coarse one; the fields that are compared are put in their place."""
    problem = measured(scene(SUPPLY, FlowModel(transport="auto")), truth, 1e-5)
    background = background_of(problem, SHORT, Marches())
    return fitted_room(background, problem, SHORT, Marches()), background.coarse


@pytest.mark.parametrize(("transport", "wanted"), [("auto", "zero_equation"), ("k_epsilon", None)])
def test_another_closure_is_tried_where_it_leaves_less_of_the_images(
    truth: Solution,
    under_k_epsilon: tuple[Analysis, Room],
    transport: Literal["auto", "k_epsilon"],
    wanted: str | None,
):
    fitted, coarse = under_k_epsilon
    assert coarse.closure == closure_name(scene(SUPPLY, FlowModel(transport=transport))) == "k_epsilon"
    stated = replace(fitted.problem, scene=scene(SUPPLY, FlowModel(transport=transport)))
    fitted = replace(fitted, problem=stated)
    # As if either room were the truth itself, a share of it, or no room at all.
    true_k = np.asarray(truth.temperature_k - 293.15)

    def where(fitted_share: float, other_share: float) -> Analysis:
        rooms = (fitted_share * true_k, other_share * true_k)
        return eqx.tree_at(lambda s: (s.best.fields.excess_k, s.other.excess_k), fitted, rooms)

    assert promising_closure(where(1.0, 0.0), coarse) is None
    assert promising_closure(where(0.9, 1.0), coarse) == wanted
    # A room that leaves half of the images is doubted whatever the coarse one says.
    assert promising_closure(where(0.5, 0.0), coarse) == wanted


@pytest.mark.parametrize(
    ("transport", "share", "worth"),
    [
        ("auto", 0.5, True),
        ("auto", 0.9, False),
        ("k_epsilon", 0.5, False),
        ("large_eddies", 0.9, True),
    ],
)
def test_large_eddies_are_marched_where_closures_leave_much_of_the_images_or_where_they_are_stated(
    truth: Solution,
    under_k_epsilon: tuple[Analysis, Room],
    transport: Literal["auto", "k_epsilon", "large_eddies"],
    share: float,
    worth: bool,
):
    fitted = under_k_epsilon[0]
    problem = replace(fitted.problem, scene=scene(SUPPLY, FlowModel(transport=transport)))
    explains_k = share * np.asarray(truth.temperature_k - 293.15)
    fitted = eqx.tree_at(lambda s: s.best.fields.excess_k, replace(fitted, problem=problem), explains_k)
    assert worth_large_eddies(fitted, SHORT) == worth
    assert not worth_large_eddies(fitted, replace(SHORT, use_images=False))


def test_the_room_with_large_eddies_keeps_its_entries_and_has_no_closure_to_fit(
    under_k_epsilon: tuple[Analysis, Room],
):
    fitted = under_k_epsilon[0]
    marches = Marches()
    found = with_large_eddies(fitted, replace(SHORT, rounds=1), marches)
    assert found.prior.names() == [name for name in fitted.prior.names() if name != "log_closure"]
    assert len(found.posterior.vector) == len(found.derivatives.others) == len(found.prior.names())
    eddies = [row for row in marches.history if row["doing"] == "march the room's large eddies"]
    assert len(eddies) == 1
    assert found.best.flow.last.turbulence is None
    assert np.isfinite(solution(found, 0.0, use_images=True).velocity_std_m_s).all()


def test_the_velocity_may_be_wrong_by_what_a_room_that_explains_as_much_has_there(
    under_k_epsilon: tuple[Analysis, Room],
):
    fitted = under_k_epsilon[0]
    fields, corner = fitted.best.fields, (slice(0, 5), slice(0, 5))
    plume_m_s = np.zeros_like(np.asarray(fields.velocity_m_s))
    plume_m_s[corner] = [0.0, 0.0, 0.4]
    rival = eqx.tree_at(lambda f: f.velocity_m_s, fields, np.asarray(fields.velocity_m_s) + plume_m_s)
    alone, beside = (solution(replace(fitted, rival=other), 0.0, use_images=True) for other in (None, rival))

    assert np.median(beside.velocity_std_m_s[..., 2][corner]) > 0.25
    far = np.s_[-5:, -5:]
    np.testing.assert_allclose(beside.velocity_std_m_s[far], alone.velocity_std_m_s[far], rtol=0.3)
    expected = [doubt_of_velocity(of, model_error_of(of)) for of in (fitted, replace(fitted, rival=rival))]
    assert expected[1] > 1.2 * expected[0]


@pytest.mark.parametrize(("left", "better"), [(0.95, False), (0.7, True)])
def test_a_room_with_more_heat_must_explain_more_than_chance_would(
    truth: Solution, under_k_epsilon: tuple[Analysis, Room], left: float, better: bool
):
    # As if the room explained half of the truth, and the warmer one all but `left` of what that leaves.
    true_k = np.asarray(truth.temperature_k - 293.15)
    without, warm = (
        eqx.tree_at(lambda s: s.best.fields.excess_k, under_k_epsilon[0], share * true_k)
        for share in (0.5, 1.0 - 0.5 * left)
    )
    assert explains_more(warm, without) == better
    assert not explains_more(without, warm)


# Heaters on no panel that is searched, nor as wide or as deep as one; one is a room without any. Of each room the
# openings are stated, and of one the walls too.
@pytest.mark.parametrize(
    ("panel", "views", "stated"),
    [
        (((1.27, 0.7), (1.75, 1.1)), ("y_max",), 2),
        (((0.93, 0.9), (1.37, 1.4)), ("y_max",), 2),
        (None, ("y_max",), 2),
        (((1.07, 1.17), (1.47, 1.65)), ("y_max", "x_max"), 2),
        (((1.27, 0.7), (1.75, 1.1)), ("y_max",), 8),
    ],
)
def test_heat_that_nobody_stated_is_looked_for_where_nothing_else_explains_the_pictures(
    panel: tuple[tuple[float, float], tuple[float, float]] | None, views: tuple[WallName, ...], stated: int
):
    openings = scene(replace(SUPPLY, temperature_k=293.15, velocity_m_s=(0.1, 0.0, 0.0))).boundary[:stated]
    heaters: tuple[Heater, ...] = ()
    if panel is not None:
        patch = Patch(wall="z_min", lower_m=panel[0], upper_m=panel[1])
        heaters = (Heater(patch=patch, temperature_k=343.15),)
    seen = tuple(looking_at(wall) for wall in views)
    there = replace(scene(SUPPLY), views=seen, boundary=(*openings, *heaters))
    entered = replace(there, boundary=openings)
    problem = measured(entered, true_room(there), 1e-5)
    problem = Problem(problem.scene, problem.shifts)
    reported: list[dict] = []
    found = solve_room(problem, SETTINGS, Watch(lambda row, growing: reported.append(row)))

    said = [note for note in found.notes if "heat that is not in the scene" in note]
    # It is looked for along each axis that is told.
    assert sum("suspected_k" in event for event in reported) == len(heaters) * len(views)
    assert bool(said) == bool(heaters)
    if panel is not None:
        # The warmest panel that is named covers most of the heater along each axis that is told.
        warmest = max(said, key=lambda note: float(re.findall(r"(\d+) K warmer", note)[0]))
        spans = re.findall(r"([xy]) = ([\d.]+) to ([\d.]+) m", warmest)
        assert [axis for axis, *_ in spans] == ["x", "y"][: len(views)]
        for (_, low, high), lower_m, upper_m in zip(spans, *panel, strict=False):
            assert min(float(high), upper_m) - max(float(low), lower_m) > 0.6 * (upper_m - lower_m)


@pytest.mark.parametrize("deviations", [-1.7, 1.3])
def test_what_a_stated_heater_gives_off_is_found(deviations: float):
    supply = replace(SUPPLY, temperature_k=293.15, velocity_m_s=(0.1, 0.0, 0.0))
    panel = Heater(patch=Patch(wall="z_min", lower_m=(1.0, 0.6), upper_m=(1.6, 1.4)), temperature_k=333.15)
    stated = replace(scene(supply), boundary=(*scene(supply).boundary, panel))
    shifts = measured(stated, true_room(stated, deviations), 1e-5).shifts
    problem = Problem(stated, shifts)

    fitted = fitted_room(background_of(problem, SETTINGS, Marches()), problem, SETTINGS, Marches())

    own = fitted.prior.names().index("heater_log_heat[0]")
    # A factor of 1.8 is one deviation.
    assert fitted.posterior.vector[own] == pytest.approx(deviations, abs=0.75)


def test_a_parameter_is_moved_by_as_far_as_it_is_uncertain(truth: Solution):
    background = background_of(measured(scene(SUPPLY), truth, 1e-5), SHORT, Marches())
    prior, first = background.prior, background.derivatives
    start, vertices = np.zeros(len(prior.active())), (SHORT.vertices,) * 3
    spread = np.linspace(0.2, 0.6, len(start))

    found, unmoved = perturbed(
        background.coarse, prior, start, spread, background.base, SHORT, vertices, Marches()
    )

    np.testing.assert_array_equal(first.apart, np.eye(len(start)))
    np.testing.assert_array_equal(found.apart, np.diag(spread))
    # The restarts begin where the room that was given ended: what is steady stays as it is.
    np.testing.assert_allclose(unmoved.fields.excess_k, background.base.fields.excess_k, atol=0.5)
    own = prior.names().index("inlet_excess_k[0]")
    warmer = [float(d.per_deviation(lambda f: f.excess_k.mean())[own]) for d in (first, found)]
    assert warmer[1] == pytest.approx(warmer[0], rel=0.2)


def test_a_level_that_thermometers_moved_is_doubted_by_half_of_that(truth: Solution):
    problem = measured(scene(SUPPLY), truth, 1e-5)
    fitted = fitted_room(background_of(problem, SHORT, Marches()), problem, SHORT, Marches())
    # As if parameters alone had made a room 2 K colder than the plane says.
    colder = eqx.tree_at(lambda s: s.best.fields.excess_k, fitted, fitted.best.fields.excess_k - 2.0)
    own, doubted = (solution(s, 0.0, use_images=True) for s in (fitted, colder))

    inside = (slice(1, -1),) * 3
    assert own.temperature_std_k is not None
    assert doubted.temperature_std_k is not None
    assert np.median(own.temperature_std_k[inside]) < 0.5
    assert doubted.temperature_std_k[inside].min() > 0.8
    # The doubt is of all places together, and nothing that is shared is beyond the deviation.
    assert doubted.temperature_shared_k is not None
    together_k = np.sqrt(np.sum(doubted.temperature_shared_k**2, axis=-1))
    assert together_k[inside].min() > 0.8
    assert (together_k <= doubted.temperature_std_k * (1 + 1e-5)).all()


def test_air_of_one_temperature_is_solved_as_well():
    supply = replace(SUPPLY, temperature_k=293.15)
    found = solve_room(Problem(scene(supply), ()), SETTINGS)

    np.testing.assert_allclose(found.temperature_k, 293.15, atol=1e-3)
    assert np.all(np.isfinite(found.temperature_std_k))
    assert float(np.abs(found.velocity_m_s).max()) > 0.1
