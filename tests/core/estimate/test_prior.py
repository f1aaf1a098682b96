"""What of a room is fitted where walls are unknown, how stubbornly, and how far each number is moved to see it."""

from dataclasses import replace

import numpy as np
import pytest

from core.estimate.diagnostics import undetermined
from core.estimate.forward_runs import Derivatives
from core.estimate.prior import room_prior
from core.geometry import WALLS
from core.objects import RoomObject
from core.problem import Problem
from core.room.forward import room
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.room.vertices import RoomFields
from core.scene import FlowModel, Heater, Inlet, Patch, Wall
from tests.core.estimate.test_temperature_levels import VERTICES, prior_of, problem


def with_walls(**kelvin: float) -> Problem:
    """The room of unknown walls, some of them stated after all."""
    given = problem(stated=False)
    walls = tuple(Wall(wall=name, thermal="temperature", temperature_k=k) for name, k in kelvin.items())
    scene = replace(given.scene, boundary=(*given.scene.boundary, *walls))
    return Problem(scene, ())


def test_the_walls_that_the_camera_looks_through_are_fitted_as_one():
    prior = prior_of(problem(stated=False))

    fitted = [name for name in prior.names() if name.startswith("wall_excess_k")]
    moved = np.where([name == "wall_excess_k[2]" for name in prior.names()], 1.5, 0.0)
    found = np.asarray(prior.parameters(moved).wall_excess_k)
    mean, std = (np.asarray(p.wall_excess_k) for p in (prior.mean, prior.std))

    assert len(fitted) == 5
    assert prior.unknown_walls() == list(WALLS)
    np.testing.assert_allclose(found[[2, 3]], (mean + 1.5 * std)[2], rtol=1e-5)
    np.testing.assert_allclose(found[[0, 1, 4, 5]], mean[[0, 1, 4, 5]])
    assert "(y_min and y_max as one" in undetermined(with_walls(z_min=293.15))[0]


@pytest.mark.parametrize("known", ["y_min", "y_max"])
def test_where_one_of_them_is_stated_the_other_is_fitted_alone(known: str):
    given = with_walls(**{known: 290.15})
    prior = prior_of(given)
    other = WALLS.index("y_max" if known == "y_min" else "y_min")

    found = np.asarray(prior.parameters(np.ones(len(prior.names()))).wall_excess_k)

    assert f"wall_excess_k[{other}]" in prior.names()
    assert f"wall_excess_k[{WALLS.index(known)}]" not in prior.names()
    assert found[WALLS.index(known)] == pytest.approx(-3.0, abs=1e-3)
    assert "as one" not in undetermined(given)[0]


def test_unknown_walls_are_not_let_go():
    unknown, stated = prior_of(problem(stated=False)), prior_of(with_walls(**dict.fromkeys(WALLS, 293.15)))

    gaussian = dict(zip(unknown.names(), unknown.gaussian(), strict=True))

    assert {n for n, f in gaussian.items() if not f} == {"inlet_excess_k[0]", "inlet_log_flow[0]"}
    # A stated wall's heat coefficient may have been entered wrongly.
    assert not dict(zip(stated.names(), stated.gaussian(), strict=True))["log_heat"]


def test_derivatives_are_per_prior_deviation_whatever_the_steps():
    def room_of(excess_k: float) -> RoomFields:
        return RoomFields(
            np.full(VERTICES, excess_k),
            np.zeros(VERTICES),
            np.zeros((*VERTICES, 3)),
            np.array([2.0 * excess_k]),
        )

    found = Derivatives(room_of(1.0), [room_of(7.0), room_of(1.6)], np.diag([2.0, 0.3]))

    np.testing.assert_allclose(found.per_deviation(lambda seen: seen.excess_k.mean()), [3.0, 2.0])
    np.testing.assert_allclose(found.per_deviation(lambda seen: seen.outflow_excess_k[0]), [6.0, 4.0])
    empty = Derivatives(room_of(1.0), [], np.zeros((0, 0)))
    assert empty.per_deviation(lambda seen: seen.excess_k).shape == (0, *VERTICES)


@pytest.mark.parametrize(
    ("flow", "fitted"),
    [
        (FlowModel(transport="given"), True),
        (FlowModel(transport="given", viscosity_m2_s=1e-3), False),
        (FlowModel(), False),
    ],
)
def test_one_viscosity_that_nobody_stated_may_vary_over_the_room(flow: FlowModel, fitted: bool):
    given = problem(stated=True)
    prior = prior_of(Problem(replace(given.scene, flow=flow), ()))
    lattice = [name for name in prior.names() if name.startswith("log_viscosity")]

    assert bool(lattice) == fitted
    assert all(prior.gaussian()[[name in lattice for name in prior.names()]])


def test_the_walls_heat_coefficient_closes_the_heat_balance():
    prior = prior_of(with_walls(**dict.fromkeys(WALLS, 293.15)))
    heat_m_s = float(np.exp(np.asarray(prior.mean.wall_log_heat)[0]))
    # 0.096 m3/s come in 5 K warmer than they leave; the air is 5 K above walls of 24 m2 without the openings.
    openings_m2 = 0.6 * 0.4 + 0.6 * 0.2
    assert heat_m_s == pytest.approx(0.096 * 5.0 / (5.0 * (24.0 - openings_m2)), rel=0.05)


def test_the_walls_heat_coefficient_stays_within_its_limits_and_makes_no_jump_where_supplies_cancel():
    given = with_walls(**dict.fromkeys(WALLS, 293.15))
    warm, exhaust, *walls = given.scene.boundary
    assert isinstance(warm, Inlet)
    cold = replace(
        warm, patch=Patch(wall="x_min", lower_m=(0.7, 1.6), upper_m=(1.3, 2.0)), temperature_k=284.15
    )
    outlet = replace(exhaust, mean_temperature_k=293.55)
    scene = replace(given.scene, boundary=(warm, cold, outlet, *walls))
    prior = prior_of(Problem(scene, ()))
    own = prior.names().index("inlet_excess_k[0]")

    steps = np.linspace(-8.0, 8.0, 81)
    vectors = np.where(np.arange(len(prior.names())) == own, steps[:, None], 0.0)
    heat = [float(np.exp(prior.parameters(v).wall_log_heat[0])) / NOMINAL_HEAT_M_S for v in vectors]

    assert 0.2499 < min(heat) < max(heat) < 4.0001
    # A step of 0.04 K of 10 in one supply.
    assert np.abs(np.diff(heat)).max() < 1.0
    assert heat[40] == pytest.approx(float(np.exp(prior.mean.wall_log_heat[0])) / NOMINAL_HEAT_M_S, rel=1e-4)


def test_a_stated_heater_is_a_part_of_the_balance_that_unknown_walls_close():
    given = problem(stated=False)
    panel = Heater(patch=Patch(wall="z_min", lower_m=(0.5, 0.5), upper_m=(1.5, 1.5)), temperature_k=343.15)
    body = RoomObject(
        name="drum",
        lower_m=(1.2, 1.2, 0.2),
        upper_m=(1.7, 1.7, 0.7),
        thermal="temperature",
        temperature_k=343.15,
    )
    supply, exhaust = given.scene.boundary
    bare = replace(given.scene, boundary=(supply, replace(exhaust, mean_temperature_k=302.15)))
    rooms = bare, replace(bare, boundary=(*bare.boundary, panel)), replace(bare, objects=(body,))
    without, heated, drum = (float(prior_of(Problem(r, ())).mean.wall_excess_k[0]) for r in rooms)

    # The panel's 0.1 K m3/s go out by 24 m2 of wall at the nominal coefficient: 3 K.
    assert heated < without - 2.0
    assert drum < without - 2.0


def test_a_viscosity_is_as_free_as_the_closure_that_is_marched_allows():
    given = problem(stated=True)
    layout = room(given.scene, 8, "k_epsilon").layout
    names = "k_epsilon", "zero_equation", "molecular"
    own, simple, none = (float(room_prior(given, layout, name).std.log_closure) for name in names)

    assert 0.0 == none < own < simple
    assert float(room_prior(given, layout).std.log_closure) == own
