"""Thermometers in what leaves: each is compared with the air of its own outlet."""

from dataclasses import replace

import numpy as np
import pytest

from core.data_error import LENGTH_SHARE, alike_share
from core.estimate.observation import observations
from core.estimate.prior import room_prior
from core.geometry import Box, looking_along_y
from core.known import leaving_excess_k
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.room.forward import room, room_fields
from core.room.vertices import RoomFields
from core.scene import FixedTexture, FlowModel, Inlet, Outlet, Patch, Scene, View, Wall

VERTICES = (9, 9, 9)
SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(0.7, 1.1), upper_m=(1.3, 1.5)),
    temperature_k=303.15,
    velocity_m_s=(0.4, 0.0, 0.0),
)
# A low return of 2.49 K and a high one, three times as large, of 7.5 K.
LOW = Outlet(patch=Patch(wall="x_max", lower_m=(0.5, 0.0), upper_m=(1.5, 0.2)), mean_temperature_k=296.15)
HIGH = Outlet(patch=Patch(wall="x_max", lower_m=(0.5, 1.4), upper_m=(1.5, 2.0)), mean_temperature_k=300.15)
UNMEASURED = replace(LOW, mean_temperature_k=None)


def problem(*outlets: Outlet) -> Problem:
    camera = looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=64, height_px=64, focal_px=250.0)
    scene = Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0)),
        views=(View(camera=camera),),
        light=FixedTexture(),
        flow=FlowModel(transport="given", viscosity_m2_s=2e-3),
        boundary=(SUPPLY, *outlets),
    )
    return Problem(scene, ())


def layered(given: Problem) -> RoomFields:
    """A room of 10 cells an edge, 2.49 K above ambient below 1 m and 7.5 K above that."""
    where = room(given.scene, 10, "constant")
    model = where.model(room_prior(given, where.layout).mean)
    flow = where.at_rest(model, np.where(where.grid.centres_m(2) < 1.0, 2.49, 7.5))
    return room_fields(flow, model, where.layout, VERTICES)


def test_each_thermometer_is_compared_with_the_air_of_its_own_outlet():
    given = problem(LOW, HIGH)
    data = observations(given, VERTICES)

    assert data.values()[0] == pytest.approx([3.0, 7.0])
    # The mean over both, by flow, is 6.25 K: what neither return has.
    assert data.predicted(layered(given)) == pytest.approx([2.49, 7.5], abs=1e-5)


def test_an_outlet_without_thermometer_takes_no_others_place():
    given = problem(UNMEASURED, HIGH)
    data = observations(given, VERTICES)

    assert data.values()[0] == pytest.approx([7.0])
    assert data.predicted(layered(given)) == pytest.approx([7.5], abs=1e-5)


def test_two_outlets_on_the_same_cells_share_what_leaves_there():
    # Both end in the middle of a cell: 0.2 m a cell.
    left = replace(LOW, patch=Patch(wall="x_max", lower_m=(0.5, 0.0), upper_m=(0.9, 0.2)))
    right = replace(LOW, patch=Patch(wall="x_max", lower_m=(0.9, 0.0), upper_m=(1.5, 0.2)))
    given = problem(left, right)

    assert layered(given).outflow_excess_k == pytest.approx([2.49, 2.49], abs=1e-5)


@pytest.mark.parametrize(
    ("outlets", "leaving_k"), [((LOW,), 3.0), ((LOW, HIGH), 6.0), ((UNMEASURED, HIGH), 7.0), ((), None)]
)
def test_what_leaves_is_the_mean_of_the_thermometers_weighted_as_the_flow_divides(outlets, leaving_k):
    assert leaving_excess_k(problem(*outlets)) == pytest.approx(leaving_k)


@pytest.mark.parametrize("thermal", ["temperature", "unknown", "adiabatic"])
def test_a_plane_tells_of_the_air_on_a_wall_that_passes_no_heat_alone(thermal):
    given, along_m = problem(HIGH), np.linspace(0.0, 2.0, 21)
    still = np.zeros((21, 21))
    plane = PlaneData("x_max", along_m, along_m, still + 300.0, still, np.zeros((21, 21, 3)))
    wall = Wall(wall="x_max", thermal=thermal, temperature_k=300.0 if thermal == "temperature" else None)
    given = Problem(replace(given.scene, boundary=(*given.scene.boundary, wall)), (), (plane,))

    assert len(observations(given, VERTICES).planes) == (thermal == "adiabatic")


def test_as_many_of_a_pictures_data_share_the_models_error_as_a_correlation_length_makes_alike():
    places = np.linspace(0, 1, 2001)
    apart = np.abs(places[:, None] - places[None, :])
    assert alike_share(1) == pytest.approx(np.exp(-apart / LENGTH_SHARE).mean(), rel=1e-3)

    given = problem(LOW, HIGH)
    centres_px = np.stack(np.meshgrid(np.arange(2.0, 64, 4), np.arange(2.0, 64, 4)), -1).reshape(-1, 2)
    shifts = ShiftMeasurement(centres_px, 0 * centres_px, np.tile(np.eye(2), (len(centres_px), 1, 1)), 4)
    data = observations(replace(given, shifts=(shifts,)), VERTICES)

    blocks = len(data.shifts[0].displacement_px)
    assert blocks > 50
    # Both components of each block, and then two thermometers that stand alone.
    assert data.alike() == pytest.approx([alike_share(2) * blocks] * (2 * blocks) + [1.0, 1.0])
