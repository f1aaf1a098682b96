"""Rooms for OpenFOAM state what is computed."""

from dataclasses import replace

import numpy as np
import pytest

from app.volume.scene import RigOptions, room_scene
from core.geometry import face_of
from core.room.forward import room
from core.room.room_grid import RoomGrid
from core.scene import Heater, Inlet, Outlet
from tests.benchmarks.foam_rooms import leaving_m3_s, on_faces
from tests.benchmarks.other_rooms import Made, empty
from tests.benchmarks.random_rooms import drawn

CELLS = 24


def grid_of(what: Made) -> RoomGrid:
    return room(room_scene(empty("room", what), RigOptions(), "surveyed"), CELLS, "k_epsilon").grid


@pytest.mark.parametrize("number", [7, 23, 103, 107])
def test_the_stated_openings_are_whole_faces_of_cells(number):
    what = drawn(number)
    grid = grid_of(what)

    scene = room_scene(empty("room", on_faces(what, grid)), RigOptions(), "surveyed")

    parts = [part for part in scene.boundary if isinstance(part, Inlet | Outlet | Heater)]
    assert len(parts) == len(what.inlets) + len(what.outlets) + (what.heater is not None)
    for part in parts:
        cells = 1
        for axis, low, high in zip(
            face_of(part.patch.wall).along, part.patch.lower_m, part.patch.upper_m, strict=True
        ):
            centres_m = grid.centres_m(axis)
            cells *= int(np.sum((centres_m > low) & (centres_m < high)))
        faces_m2 = cells * grid.face_area_m2(face_of(part.patch.wall).axis)
        assert faces_m2 == pytest.approx(part.patch.area_m2, rel=1e-4)


def test_a_slot_narrower_than_a_cell_becomes_one_cell_wide():
    what = drawn(1)
    slot = {"y": [0.4, 0.41], "z": [1.0, 1.4], "U": 0.3, "dT": 2.0}
    grid = grid_of(what)

    (inlet,) = on_faces(replace(what, inlets=(slot,)), grid).inlets

    assert np.ptp(inlet["y"]) == pytest.approx(grid.spacing_m[1], rel=1e-4)


def test_outlets_take_what_the_supplies_bring_each_by_the_air_beside_it():
    what = on_faces(drawn(103), grid_of(drawn(103)))
    grid, scene = grid_of(what), room_scene(empty("room", what), RigOptions(), "surveyed")
    on_x_min, on_ceiling = (part for part in scene.boundary if isinstance(part, Outlet))
    velocity = np.zeros((*grid.cells, 3))
    # Out by both: twice as fast through the ceiling.
    velocity[0, ..., 0], velocity[..., -1, 2] = -1.0, 2.0

    taken = leaving_m3_s(velocity, scene, grid)

    brought = sum(p.inward_m_s * p.patch.area_m2 for p in scene.boundary if isinstance(p, Inlet))
    assert sum(taken) == pytest.approx(brought)
    assert taken[1] / taken[0] == pytest.approx(2.0 * on_ceiling.patch.area_m2 / on_x_min.patch.area_m2)
