"""Rooms that no fit was tuned on, made by the room solver at other settings than the reconstruction's.

Another turbulence model or another closure constant, other walls' heat, a finer grid, other sizes and numbers
of vertices. Each is written in the format of a room volume (NPZ), so that `airlens simulate --truth`,
`reconstruct` and `score` take it as any other. One JSON line a room: how the march ended, and its cost.

    python -m tests.benchmarks.other_rooms FOLDER [--only jet]
"""

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from app.volume.file import RoomVolume
from app.volume.scene import RigOptions, room_scene
from core.estimate.prior import room_prior
from core.problem import Problem
from core.room.forward import Room, carried_over, room, room_fields
from core.room.march import MarchSettings, march
from core.room.room_grid import AXES, RoomGrid
from core.room.step import RoomModel
from core.room.vertices import cell_matrix

T0_K, NU, PRANDTL = 293.15, 1.5e-5, 0.71
SIDES = ["xMaxWall", "front", "back"]
INSULATED = ["floor", "ceiling", "xMinWall"]


@dataclass(frozen=True)
class Made:
    """One room to make: its box, openings, walls, and the model that stands for the truth."""

    domain: tuple[float, float, float, float, float, float]
    vertices: tuple[int, int, int]
    closure: str
    cells: int
    title: str
    inlets: tuple[dict[str, Any], ...] = ()
    outlets: tuple[dict[str, Any], ...] = ()
    heater: dict[str, Any] | None = None
    wall_t: tuple[tuple[str, float], ...] = ()
    adiabatic: tuple[str, ...] = tuple(INSULATED)
    heat_factor: float = 1.3
    closure_factor: float = 1.0
    settle_s: float = 300.0
    refine_s: float = 80.0


def _box(y: tuple[float, float], z: tuple[float, float]) -> dict[str, Any]:
    return {"y": list(y), "z": list(z)}


ROOMS = {
    "jet": Made(
        domain=(0.0, 4.8, -1.8, 1.8, 0.0, 2.7),
        vertices=(66, 50, 42),
        closure="zero_equation",
        cells=64,
        title="cool jet below the ceiling, zero-equation truth",
        inlets=({**_box((-0.35, 0.35), (2.25, 2.45)), "U": 0.6, "dT": -5.0},),
        outlets=(_box((0.6, 1.2), (0.2, 0.6)),),
        wall_t=(("back", T0_K + 1.0),),
    ),
    "plume": Made(
        domain=(-1.5, 1.9, -1.4, 1.4, 0.0, 3.2),
        vertices=(56, 46, 60),
        closure="k_epsilon",
        cells=56,
        title="plume over a heated floor patch, displacement supply",
        inlets=({**_box((-0.6, 0.6), (0.05, 0.45)), "U": 0.12, "dT": -1.0},),
        outlets=(_box((-0.3, 0.3), (2.7, 3.0)),),
        heater={"x": [0.2, 0.8], "y": [-0.3, 0.3], "dT": 60.0},
        closure_factor=1.3,
    ),
    "weak_plume": Made(
        domain=(-1.6, 1.8, -1.5, 1.5, 0.0, 2.7),
        vertices=(58, 50, 48),
        closure="k_epsilon",
        cells=56,
        title="plume over a warm floor patch, supply at the room's temperature",
        inlets=({**_box((-0.5, 0.5), (0.1, 0.5)), "U": 0.05, "dT": 0.0},),
        outlets=(_box((-0.3, 0.3), (2.25, 2.5)),),
        heater={"x": [0.0, 0.6], "y": [-0.2, 0.4], "dT": 25.0},
        closure_factor=0.8,
    ),
    "two_inlets": Made(
        domain=(-1.2, 2.6, -1.6, 1.6, 0.0, 2.8),
        vertices=(60, 52, 46),
        closure="zero_equation",
        cells=60,
        title="a warm and a cool jet side by side",
        inlets=(
            {**_box((-0.9, -0.4), (1.7, 1.95)), "U": 0.4, "dT": 6.0},
            {**_box((0.5, 0.9), (1.1, 1.35)), "U": 0.5, "dT": -2.0},
        ),
        outlets=(_box((-0.3, 0.3), (0.15, 0.5)),),
    ),
    "constant": Made(
        domain=(-1.0, 2.6, -1.3, 1.7, 0.0, 2.9),
        vertices=(58, 48, 48),
        closure="constant",
        cells=56,
        title="warm jet off the middle, constant eddy viscosity",
        inlets=({**_box((-0.1, 0.5), (1.3, 1.55)), "U": 0.45, "dT": 7.0},),
        outlets=(_box((-0.9, -0.3), (2.2, 2.6)),),
    ),
}


def _in_time(seconds: float) -> MarchSettings:
    """A march that is true in time: a truth may go on moving."""
    return MarchSettings(longest_s=seconds, window_s=5.0, tolerance=0.004, steady=False)


def marched(name: str, what: Made) -> tuple[dict[str, Any], dict[str, Any]]:
    """The room's arrays and a row about how it was made."""
    began_s = time.process_time()
    volume = empty(name, what)
    scene = room_scene(volume, RigOptions(), "surveyed")
    coarse, fine = (room(scene, n, what.closure) for n in (32, what.cells))
    parameters = room_prior(Problem(scene, (), ()), coarse.layout).mean
    parameters = eqx.tree_at(
        lambda p: (p.log_heat, p.log_closure),
        parameters,
        (jnp.float32(np.log(what.heat_factor)), jnp.float32(np.log(what.closure_factor))),
    )
    model = coarse.model(parameters)
    excess = 0.5 * float(np.mean([i["dT"] for i in what.inlets] or [1.0]))
    flow = coarse.at_rest(model, np.full(coarse.grid.cells[2], excess))
    first = march(flow, model, _in_time(what.settle_s))
    model = fine.model(parameters)
    flow = carried_over(first.last, coarse.grid, fine.grid)
    last = march(flow, model, _in_time(what.refine_s))
    row = {
        "room": name,
        "closure": what.closure,
        "cells": list(fine.grid.cells),
        "coarse_change": first.change,
        "change": last.change,
        "outcome": last.outcome.name,
        "cpu_s": time.process_time() - began_s,
    }
    return _arrays(what, volume, fine, model, last.mean), row


def empty(name: str, what: Made) -> RoomVolume:
    """Still air on the room's vertices, with the case described."""
    x0, x1, y0, y1, z0, z1 = what.domain
    axes = [np.linspace(a, b, n) for a, b, n in zip((x0, y0, z0), (x1, y1, z1), what.vertices, strict=True)]
    case = {
        "name": name,
        "title": what.title,
        "T0": T0_K,
        "beta": 1.0 / T0_K,
        "nu": NU,
        "Pr": PRANDTL,
        "Prt": 0.85,
        "g": 9.81,
        "domain": list(what.domain),
        "outlets": list(what.outlets),
        "adiabatic_walls": list(what.adiabatic),
        "TI": 0.1,
        "lscale": 0.07,
        "heater": what.heater,
        "inlets": list(what.inlets),
    }
    # One of the format's two ways to state walls: all at T0, or each by name.
    warm = dict(what.wall_t)
    case |= {"wall_T": dict.fromkeys(SIDES, T0_K) | warm} if warm else {"isothermal_walls": SIDES}
    zero = np.zeros(what.vertices, np.float32)
    return RoomVolume(
        *axes,
        temperature_k=zero + np.float32(T0_K),
        pressure_m2_s2=zero,
        velocity_m_s=np.zeros((*what.vertices, 3), np.float32),
        ambient_k=T0_K,
        case=case,
        scalars={"nu": NU, "Pr": PRANDTL},
    )


def _arrays(what: Made, volume: RoomVolume, fine: Room, model: RoomModel, flow: Any) -> dict[str, Any]:
    """The volume's arrays, of a flow on its cells."""
    field = room_fields(flow, model, fine.layout, what.vertices)
    nut = np.pad(np.asarray(model.viscosity(flow).cells_m2_s) - NU, 1, mode="edge")
    nut = on_vertices(nut, fine.grid, what.vertices)
    kelvin = T0_K + field.excess_k
    return arrays_of(
        what, volume, kelvin, field.pressure_m2_s2, field.velocity_m_s, nut, f"airlens {what.closure}"
    )


def on_vertices(extended: np.ndarray, grid: RoomGrid, vertices: tuple[int, int, int]) -> np.ndarray:
    """A field on cells, with a layer on the walls around them, at the room's vertices."""
    for a in AXES:
        matrix = cell_matrix(grid, a, vertices[a])
        extended = np.moveaxis(np.tensordot(matrix, extended, (1, a)), 0, a)
    return extended


def arrays_of(
    what: Made,
    volume: RoomVolume,
    temperature_k: np.ndarray,
    pressure_m2_s2: np.ndarray,
    velocity_m_s: np.ndarray,
    nut_m2_s: np.ndarray,
    solver: str,
) -> dict[str, Any]:
    """The volume's arrays, named as in the format; fields are on its vertices."""
    inlets = [i for i in what.inlets if _on_x_min(i)]
    arrays = {"x": volume.x_m, "y": volume.y_m, "z": volume.z_m}
    arrays |= {"T": temperature_k, "p": pressure_m2_s2, "u": velocity_m_s, "nut": nut_m2_s}
    arrays |= {f"bc_{k}": arrays[k][0] for k in ("T", "p", "u", "nut")}
    arrays = {k: np.asarray(v, np.float32) for k, v in arrays.items()}
    arrays |= {
        "bc_mask": _mask(what, volume),
        "bc_x": np.float32(what.domain[0]),
        "e_g": np.array([0.0, 0.0, -1.0]),
        "T_in": np.array([T0_K + i["dT"] for i in inlets]),
        "U_in": np.array([i["U"] for i in inlets]),
        "inlet_box_yz": np.array([[*i["y"], *i["z"]] for i in inlets]).reshape(-1, 4),
    }
    numbers = {"T0": T0_K, "rho0": 1.2041, "G": 2.26e-4, "beta": 1.0 / T0_K, "nu": NU, "Pr": PRANDTL}
    arrays |= {k: np.float64(v) for k, v in (numbers | {"Prt": 0.85, "g": 9.81}).items()}
    arrays["meta_json"] = np.array(json.dumps({"case": volume.case, "solver": solver}))
    return arrays


def _mask(what: Made, volume: RoomVolume) -> np.ndarray:
    """1, 2 inlets, -1 outlets, 0 wall on x_min."""
    mask = np.zeros((len(volume.y_m), len(volume.z_m)), np.int8)
    patches = [(n + 1, i) for n, i in enumerate(what.inlets)] + [(-1, box) for box in what.outlets]
    axes = {"y": volume.y_m, "z": volume.z_m}
    for value, box in patches:
        if not _on_x_min(box):
            continue
        inside = [(axis >= box[a][0]) & (axis <= box[a][1]) for a, axis in axes.items()]
        mask[np.ix_(*inside)] = value
    return mask


def _on_x_min(box: dict[str, Any]) -> bool:
    return box.get("wall", "xMinWall") == "xMinWall"


def main() -> None:
    """Make the rooms and say what each cost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", choices=sorted(ROOMS), action="append")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.only or ROOMS:
        arrays, row = marched(name, ROOMS[name])
        np.savez_compressed(options.folder / f"{name}.npz", **arrays)
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
