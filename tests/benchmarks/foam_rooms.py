"""Rooms as `random_rooms` draws them, computed by OpenFOAM (where it is installed) under one of its three models.

k-epsilon, RNG k-epsilon and k-omega SST by turns; the steady solver from rest, and the mean over its later
iterations. OpenFOAM's openings are whole faces of cells. So each opening and heater is moved to faces first, and the
volume states the room that is computed. Not a benchmark by itself: `random_rooms --by openfoam` takes its rooms from
here.
"""

import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.bench.foam_case import SOLVER, Turbulence, read_field, write_case
from app.bench.openfoam import environment, run_foam
from app.volume.scene import RigOptions, room_scene
from core.air import GRAVITY_M_S2
from core.geometry import face_of
from core.known import stated_walls, supplied_m3_s
from core.room.forward import room
from core.room.room_grid import RoomGrid
from core.scene import Heater, Inlet, Outlet, Patch, Scene
from tests.benchmarks.other_rooms import Made, arrays_of, empty, on_vertices

MODELS: tuple[Turbulence, ...] = ("kEpsilon", "RNGkEpsilon", "kOmegaSST")
# Iterations in all, and from where on their mean is taken.
_MOST, _MEAN_FROM = 3000, 1500


def computed(
    name: str, what: Made, model: Turbulence, cells: int = 40
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The room's arrays, and a row about how it was made. Raises BadInputError where OpenFOAM fails."""
    grid = room(room_scene(empty(name, what), RigOptions(), "surveyed"), cells, "k_epsilon").grid
    what = on_faces(what, grid)
    volume = empty(name, what)
    scene = room_scene(volume, RigOptions(), "surveyed")
    variables = environment()
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder)
        write_case(case, scene, grid.cells, _MEAN_FROM // 2, _MOST, model, _MEAN_FROM)
        for command in (["blockMesh"], ["topoSet"], ["createPatch", "-overwrite"]):
            run_foam(command, case, variables)
        log = run_foam([SOLVER], case, variables)
        means = {
            n: read_field(case / str(_MOST) / f"{n}Mean", grid.cells) for n in ("U", "T", "p_rgh", "nut")
        }
        half = {n: read_field(case / str(_MOST * 3 // 4) / f"{n}Mean", grid.cells) for n in ("U", "T")}
    spent_s = float(re.findall(r"ExecutionTime = ([\d.]+) s", log)[-1])
    centres = tuple(grid.centres_m(axis) for axis in range(3))
    row = {
        "room": name,
        "closure": model,
        "cells": list(grid.cells),
        "change_k": float(np.sqrt(np.mean((means["T"] - half["T"]) ** 2))),
        "change_u": float(np.sqrt(np.mean((means["U"] - half["U"]) ** 2) / np.mean(means["U"] ** 2))),
        "outlets_m3_s": leaving_m3_s(means["U"], scene, grid),
        "cpu_s": spent_s,
    }
    kelvin = _on_walls(means["T"], scene, centres, "T")[..., 0]
    velocity = _on_walls(means["U"], scene, centres, "u")
    # Pressure passes a wall's surface as it is in the air beside it, whatever the surface's temperature.
    warmer_k = means["T"][..., 0] - scene.air.ambient_temperature_k
    hydrostatic = GRAVITY_M_S2 * scene.air.expansion_per_k * warmer_k * centres[2]
    pressure, nut = (
        np.pad(of, 1, mode="edge") for of in (means["p_rgh"][..., 0] + hydrostatic, means["nut"][..., 0])
    )
    kelvin, pressure, velocity, nut = (
        on_vertices(field, grid, what.vertices) for field in (kelvin, pressure, velocity, nut)
    )
    return arrays_of(what, volume, kelvin, pressure - pressure.mean(), velocity, nut, model), row


def leaving_m3_s(velocity_m_s: np.ndarray, scene: Scene, grid: RoomGrid) -> list[float]:
    """What leaves by each outlet, from the air beside it; all of it is what the supplies bring."""
    centres_m, leaving = tuple(grid.centres_m(axis) for axis in range(3)), []
    for part in scene.boundary:
        if isinstance(part, Outlet):
            face = face_of(part.patch.wall)
            outward = -face.inward * np.take(velocity_m_s[..., face.axis], face.end, axis=face.axis)
            leaving.append(float(outward[_covered(part.patch, centres_m)].mean() * part.patch.area_m2))
    return [flow * supplied_m3_s(scene) / sum(leaving) for flow in leaving]


def on_faces(what: Made, grid: RoomGrid) -> Made:
    """The room with its openings and its heater moved to faces of cells; none is narrower than a cell."""

    def moved(box: dict[str, Any]) -> dict[str, Any]:
        spans = {
            name: _nearest(box[name], grid.faces_m(axis)) for axis, name in enumerate("xyz") if name in box
        }
        return box | spans

    return replace(
        what,
        inlets=tuple(map(moved, what.inlets)),
        outlets=tuple(map(moved, what.outlets)),
        heater=None if what.heater is None else moved(what.heater),
    )


def _nearest(span_m: list[float], faces_m: np.ndarray) -> list[float]:
    first, last = (int(np.argmin(np.abs(faces_m - edge))) for edge in span_m)
    first = min(first, len(faces_m) - 2)
    return [round(float(faces_m[n]), 6) for n in (first, max(last, first + 1))]


def _covered(patch: Patch, centres_m: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Places of a patch's faces on its wall, as an index."""
    return np.ix_(
        *(
            np.flatnonzero((centres_m[axis] > low) & (centres_m[axis] < high))
            for axis, low, high in zip(face_of(patch.wall).along, patch.lower_m, patch.upper_m, strict=True)
        )
    )


def _on_walls(
    cells: np.ndarray, scene: Scene, centres_m: tuple[np.ndarray, ...], kind: Literal["T", "u"]
) -> np.ndarray:
    """The field with a layer on the walls: what is held or supplied there, else that of the next cell."""
    wide = np.pad(cells, [(1, 1)] * 3 + [(0, 0)], mode="edge")
    walls = stated_walls(scene)
    for name, wall in walls.items():
        face = face_of(name)
        plane = (slice(None),) * face.axis + (0 if name.endswith("min") else -1,)
        if kind == "u":
            wide[plane] = 0.0
        elif wall is not None and wall.temperature_k is not None:
            wide[plane] = wall.temperature_k
    for part in scene.boundary:
        if not isinstance(part, Inlet | Outlet | Heater):
            continue
        face = face_of(part.patch.wall)
        planes = np.moveaxis(wide, face.axis, 0)
        on_wall, beside = (planes[0], planes[1]) if face.end == 0 else (planes[-1], planes[-2])
        covered = tuple(1 + places for places in _covered(part.patch, centres_m))
        if isinstance(part, Outlet):
            on_wall[covered] = beside[covered]
        elif kind == "T":
            on_wall[covered] = part.temperature_k
        elif isinstance(part, Inlet):
            on_wall[covered] = part.velocity_m_s
    return wide
