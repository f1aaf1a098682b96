"""What leaves by an outlet, and the heat that a measured level asks for."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.diagnostics import balances
from core.estimate.observation import observations
from core.estimate.prior import Prior, room_prior
from core.estimate.temperature_levels import layers_k, outlets_apart_k, surfaces_std_k
from core.geometry import WALLS, Box, looking_along_y
from core.problem import Problem
from core.room.forward import room
from core.room.vertices import RoomFields
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall

VERTICES = (9, 8, 7)


def problem(*, stated: bool) -> Problem:
    """A room with a supply of 10 K above ambient; its walls adiabatic, or unknown."""
    supply = Inlet(
        patch=Patch(wall="x_min", lower_m=(0.7, 1.1), upper_m=(1.3, 1.5)),
        temperature_k=303.15,
        velocity_m_s=(0.4, 0.0, 0.0),
    )
    exhaust = Outlet(
        patch=Patch(wall="x_min", lower_m=(0.7, 0.4), upper_m=(1.3, 0.6)), mean_temperature_k=298.15
    )
    walls = tuple(Wall(wall=name, thermal="adiabatic") for name in WALLS) if stated else ()
    camera = looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=64, height_px=64, focal_px=200.0)
    scene = Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0)),
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(supply, exhaust, *walls),
    )
    return Problem(scene, ())


def prior_of(given: Problem) -> Prior:
    return room_prior(given, room(given.scene, 8, "constant").layout)


def test_what_leaves_is_as_uncertain_as_rooms_differ_in_drawing_it_from_elsewhere_than_its_height():
    data = observations(problem(stated=True), VERTICES)

    def drawing(level_k: float, apart_k: float) -> RoomFields:
        air = np.full(VERTICES, level_k)
        return RoomFields(air, 0.0 * air, np.zeros((*VERTICES, 3)), np.array([level_k + apart_k]))

    near, beside, far = drawing(5.0, 0.0), drawing(6.0, 0.3), drawing(4.0, -0.4)
    pairs = [(near, near), (near, drawing(7.0, 0.0))]
    assert outlets_apart_k(data, near, pairs) == pytest.approx(0.0, abs=1e-9)
    assert outlets_apart_k(data, near, [(near, beside), (far, near)]) == pytest.approx(0.5)


def test_an_outlet_may_draw_from_any_place_along_its_wall_at_its_heights():
    data = observations(problem(stated=False), VERTICES)
    excess_k = np.full(VERTICES, 5.0)
    # Heights 0 to 2 m on 7 vertices; the outlet lies from 0.4 to 0.6 m. Cold air beside it, and on another wall.
    excess_k[1, 1:4, 1:3] = 3.0
    excess_k[1, :, 5] = -9.0
    excess_k[-2, 2, 1] = -9.0
    # Layers count by their mean: an outlet mixes its heights.
    excess_k[:, :, 1] += 0.7
    excess_k[:, :, 2] -= 0.7
    room = RoomFields(excess_k, 0.0 * excess_k, np.zeros((*VERTICES, 3)), np.array([5.0]))

    # Three of the six places between the side walls are 2 K colder.
    assert outlets_apart_k(data, room, ()) == pytest.approx(1.0)


def test_the_surface_of_an_unknown_wall_may_be_as_far_from_the_air_as_its_fitted_temperature():
    given = problem(stated=False)
    data, layout = observations(given, VERTICES), room(given.scene, 8, "constant").layout
    walls_k = np.array([1.0, 2.0, 50.0, 50.0, 4.0, 8.0])
    std_k = surfaces_std_k(data, layout, walls_k, np.full(VERTICES, 3.0))

    assert std_k[-1, 3, 3] == pytest.approx(1.0)
    assert std_k[4, 3, -1] == pytest.approx(5.0)
    assert std_k[4, 3, 0] == pytest.approx(1.0)
    # The camera sees through the walls of y: their vertices show the fitted temperature.
    assert not std_k[1:-1, 0, 1:-1].any()
    # A vertex in the supply, and one beside it.
    assert std_k[0, 4, 4] < 0.3
    assert std_k[0, 1, 3] == pytest.approx(2.0)
    assert not std_k[1:-1, 1:-1, 1:-1].any()


def test_the_surface_of_a_stated_wall_may_be_off_by_its_stated_deviation():
    held = problem(stated=True)
    warm = Wall(wall="x_min", thermal="temperature", temperature_k=295.0, temperature_std_k=0.4)
    boundary = (warm, *(part for part in held.scene.boundary if getattr(part, "wall", None) != "x_min"))
    held = replace(held, scene=replace(held.scene, boundary=boundary))
    layout = room(held.scene, 8, "constant").layout
    std_k = surfaces_std_k(observations(held, VERTICES), layout, np.zeros(6), np.full(VERTICES, 3.0))

    assert std_k[0, 1, 5] == pytest.approx(0.4)
    # A vertex in the supply; the other walls are adiabatic and show the air.
    assert std_k[0, 4, 4] < 0.1
    assert not std_k[1:].any()


def test_beside_floor_and_ceiling_the_air_is_as_uncertain_as_models_differ_from_the_layers_edge_on():
    # Of 41 vertices over the height those below the third see no window.
    apart_k = np.zeros((9, 8, 41))
    apart_k[:, :, 1] = 0.4
    apart_k[:, :, -2] = -0.3
    floor, ceiling = layers_k([apart_k, 2.0 * apart_k])

    assert floor[4, 4, 1] == pytest.approx(0.4 * np.sqrt(5 / 2))
    assert ceiling[4, 4, -2] == pytest.approx(0.3 * np.sqrt(5 / 2))
    assert not floor[:, :, 3:].any()
    assert not ceiling[:, :, :-3].any()


def test_a_level_in_which_models_differ_is_no_layer():
    assert not layers_k([np.full((9, 8, 41), 0.7)]).any()


@pytest.mark.parametrize(
    ("warmer_k", "std_k", "said"),
    [(3.0, 1.0, "W more"), (-3.0, 1.0, "W less"), (0.2, 0.05, None), (3.0, 2.0, None)],
)
def test_heat_that_the_measured_level_asks_for_is_said_where_it_matters_and_is_no_chance(
    warmer_k: float, std_k: float, said: str | None
):
    given = problem(stated=True)
    parameters = prior_of(given).mean
    parameters = eqx.tree_at(lambda p: p.inlet_excess_k, parameters, jnp.array([10.0]))

    # Of 10 K that come in, a tenth is what counts; and no more than twice the deviation may be chance.
    sentences = balances(parameters, np.array([0.1]), 8.0, given, warmer_k, std_k)

    assert [said in s for s in sentences[1:]] == ([True] if said else [])
