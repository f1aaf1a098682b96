"""Flows round objects beside published figures, and what objects cost.

    python -m tests.benchmarks.objects step plume cost [--cells-a-step 12] [--plume-cell-m 0.1]

`step`: a backward-facing step, a box as wide as its channel, which is 1.5 times as high behind it. The flow comes
back to the floor 7.0 step heights behind it (Kim, Kline and Johnston 1980).
`plume`: a block of 0.4 m gives 100 W to still air. At the height z a plume carries Q = C B^(1/3) (z - z0)^(5/3) of
air, B the flux of buoyancy: Q^(3/5) is a straight line, with C = 0.153 (Rouse, Yih and Humphreys 1952). `straight`
is the share of its variance that the line explains.
`cost`: processor seconds of a pair of steps on 32, 48 and 64 cells, with a person and a desk and without, in turn.
"""

import argparse
import json
import time

import jax
import jax.numpy as jnp
import numpy as np

from core.geometry import Box, WallName, looking_along_y
from core.objects import RoomObject
from core.room.boundary_conditions import RoomParameters, room_layout
from core.room.forward import Room, room
from core.room.march import MarchSettings, advance_chunk, march
from core.room.pace import step_limits
from core.room.room_grid import RoomGrid
from core.room.step import Flow
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall

_STEP_M, _SPEED_M_S, _REATTACHES = 0.5, 1.0, 7.0
_POWER_W, _PLUME = 100.0, 0.153


def main() -> None:
    """Print the lines of the parts that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="+", choices=("step", "plume", "cost"))
    parser.add_argument("--cells-a-step", type=int, default=12)
    parser.add_argument("--plume-cell-m", type=float, default=0.1)
    asked = parser.parse_args()
    if "step" in asked.parts:
        _say(step(asked.cells_a_step))
    if "plume" in asked.parts:
        _say(plume(asked.plume_cell_m))
    if "cost" in asked.parts:
        for cells in (32, 48, 64):
            _say(cost(cells))


def step(cells_a_step: int) -> dict[str, float | str]:
    """Where the flow behind a step comes back to the floor, in step heights."""
    before_m, size_m = 4 * _STEP_M, (26 * _STEP_M, 4.0, 3 * _STEP_M)
    cells = (26 * cells_a_step, 4, 3 * cells_a_step)
    scene = _scene(
        size_m,
        (
            Inlet(
                patch=Patch(wall="x_min", lower_m=(0.0, _STEP_M), upper_m=(size_m[1], size_m[2])),
                temperature_k=293.15,
                velocity_m_s=(_SPEED_M_S, 0.0, 0.0),
                turbulence_intensity=0.01,
            ),
            Outlet(patch=Patch(wall="x_max", lower_m=(0.0, 0.0), upper_m=(size_m[1], size_m[2]))),
            Wall(wall="y_min", thermal="adiabatic", no_slip=False),
            Wall(wall="y_max", thermal="adiabatic", no_slip=False),
        ),
        RoomObject(name="step", lower_m=(0.0, 0.0, 0.0), upper_m=(before_m, size_m[1], _STEP_M)),
    )
    where = _room(scene, cells, _SPEED_M_S)
    began = time.process_time()
    mean, model_s = _marched(where, MarchSettings(longest_s=150.0, tolerance=2e-3, least_s=60.0))
    along = np.asarray(mean.velocity[0])[:, :, 0].mean(axis=1)
    faces_m = where.grid.faces_m(0) - before_m
    behind = faces_m > 0.5 * _STEP_M
    back = np.flatnonzero(behind[:-1] & (along[:-1] < 0) & (along[1:] >= 0))[-1]
    share = -along[back] / (along[back + 1] - along[back])
    found = float(faces_m[back] + share * where.grid.spacing_m[0]) / _STEP_M
    return {
        "part": "step", "cells_a_step": cells_a_step, "reattaches": found, "published": _REATTACHES,
        "ratio": found / _REATTACHES, "model_s": model_s, "cpu_s": time.process_time() - began,
    }  # fmt: skip


def plume(cell_m: float) -> dict[str, float | str]:
    """How much air rises over a warm block, height by height."""
    size_m, block_m = (4.0, 4.0, 5.0), 0.4
    buoyancy_m4_s3 = 9.81 / 293.15 * _POWER_W / 1206.0
    # More than the plume needs at the ceiling, so that the air round it stays as it is.
    supply_m_s = 1.5 * _PLUME * buoyancy_m4_s3 ** (1 / 3) * size_m[2] ** (5 / 3) / (2 * size_m[1] * size_m[2])
    sides: tuple[tuple[WallName, float], ...] = (("x_min", 1.0), ("x_max", -1.0))
    walls = [
        Inlet(
            patch=Patch(wall=wall, lower_m=(0.0, 0.0), upper_m=(size_m[1], size_m[2])),
            temperature_k=293.15,
            velocity_m_s=(way * supply_m_s, 0.0, 0.0),
        )
        for wall, way in sides
    ]
    scene = _scene(
        size_m,
        (
            *walls,
            Outlet(patch=Patch(wall="z_max", lower_m=(0.0, 0.0), upper_m=size_m[:2])),
            Wall(wall="y_min", thermal="adiabatic", no_slip=False),
            Wall(wall="y_max", thermal="adiabatic", no_slip=False),
            Wall(wall="z_min", thermal="adiabatic", no_slip=False),
        ),
        RoomObject(
            name="block",
            lower_m=(2.0 - 0.5 * block_m, 2.0 - 0.5 * block_m, 0.0),
            upper_m=(2.0 + 0.5 * block_m, 2.0 + 0.5 * block_m, block_m),
            thermal="power",
            power_w=_POWER_W,
        ),
    )
    where = _room(scene, tuple(round(size / cell_m) for size in size_m), 0.3)
    began = time.process_time()
    mean, model_s = _marched(where, MarchSettings(longest_s=300.0, tolerance=5e-3, least_s=120.0), _POWER_W)
    upward = np.asarray(mean.velocity[2], np.float64)
    heights_m = where.grid.faces_m(2)
    between = (heights_m > 1.2) & (heights_m < 3.8)
    carried = np.array([_carried(plane) for plane in np.moveaxis(upward, 2, 0)[between]]) * cell_m**2
    height_m, power = heights_m[between], carried**0.6
    slope, offset = np.polyfit(height_m, power, 1)
    left = np.var(power - slope * height_m - offset) / np.var(power)
    constant = float(slope ** (5 / 3) / buoyancy_m4_s3 ** (1 / 3))
    return {
        "part": "plume", "cell_m": cell_m, "C": constant, "published": _PLUME, "ratio": constant / _PLUME,
        "straight": float(1 - left), "origin_m": float(-offset / slope), "model_s": model_s,
        "cpu_s": time.process_time() - began,
    }  # fmt: skip


def _carried(upward_m_s: np.ndarray) -> float:
    """The sum of what rises faster than the air round it, out to a twentieth of the fastest."""
    above = upward_m_s - np.median(upward_m_s)
    return float(above[above > 0.05 * above.max()].sum())


def cost(cells: int, pairs: int = 5, rounds: int = 12) -> dict[str, float | str]:
    """Processor seconds of a pair of steps with objects and without, the least of several rounds."""
    size_m = (4.0, 4.0, 4.0)
    openings = (
        Inlet(
            patch=Patch(wall="x_min", lower_m=(1.5, 0.2), upper_m=(2.5, 0.7)),
            temperature_k=291.15,
            velocity_m_s=(0.2, 0.0, 0.0),
        ),
        Outlet(patch=Patch(wall="x_min", lower_m=(1.5, 3.0), upper_m=(2.5, 3.5))),
    )
    standing = (
        RoomObject(
            name="person", lower_m=(1.5, 2.0, 0.0), upper_m=(1.9, 2.3, 1.2), thermal="power", power_w=75.0
        ),
        RoomObject(name="desk", lower_m=(2.2, 1.5, 0.0), upper_m=(2.8, 2.8, 0.75)),
    )
    flows, models, least_s = [], [], [np.inf, np.inf]
    limits = step_limits(0.45, 0.02, steady=True)
    for things in ((), standing):
        where = room(_scene(size_m, openings, *things), cells, "k_epsilon")
        models.append(where.model(_parameters(where, 75.0)))
        flow = where.at_rest(models[-1], np.zeros(where.grid.cells[2]))
        flows.append(advance_chunk(flow, models[-1], jnp.int32(pairs), limits)[0])
    for _ in range(rounds):
        for which, (flow, model) in enumerate(zip(flows, models, strict=True)):
            began = time.process_time()
            jax.block_until_ready(advance_chunk(flow, model, jnp.int32(pairs), limits))
            least_s[which] = min(least_s[which], (time.process_time() - began) / pairs)
    return {
        "part": "cost", "cells": cells, "empty_s": least_s[0], "objects_s": least_s[1],
        "times": least_s[1] / least_s[0],
    }  # fmt: skip


def _scene(size_m: tuple[float, float, float], boundary: tuple, *objects: RoomObject) -> Scene:
    camera = looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=64, height_px=64, focal_px=200.0)
    box = Box(lower_m=(0.0, 0.0, 0.0), upper_m=size_m)
    return Scene(
        room=box, views=(View(camera=camera),), light=FixedTexture(), boundary=boundary, objects=objects
    )


def _room(scene: Scene, cells: tuple[int, ...], speed_m_s: float) -> Room:
    """On cells of any shape."""
    nx, ny, nz = cells
    lx, ly, lz = scene.room.size_m
    grid = RoomGrid(cells=(nx, ny, nz), lower_m=scene.room.lower_m, spacing_m=(lx / nx, ly / ny, lz / nz))
    return Room(scene, room_layout(scene, grid), "k_epsilon", speed_m_s)


def _marched(where: Room, settings: MarchSettings, power_w: float = 0.0) -> tuple[Flow, float]:
    model = where.model(_parameters(where, power_w))
    done = march(where.at_rest(model, np.zeros(where.grid.cells[2])), model, settings)
    return done.mean, done.model_s


def _parameters(where: Room, power_w: float) -> RoomParameters:
    """Supply and walls at the ambient temperature, no heat through walls, `power_w` from each object."""
    inlets, objects = len(where.layout.inlets), len(where.layout.objects)
    return RoomParameters(
        jnp.zeros(inlets),
        jnp.zeros(inlets),
        jnp.float32(0.0),
        jnp.zeros(6),
        jnp.full(6, np.log(1e-12)),
        jnp.zeros(0),
        jnp.zeros(0),
        jnp.float32(0.0),
        jnp.zeros((3, 3, 4)),
        jnp.full(objects, power_w),
        jnp.zeros(objects),
        jnp.full(objects, np.log(2.5e-3)),
    )


def _say(row: dict[str, float | str]) -> None:
    print(json.dumps({k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}), flush=True)


if __name__ == "__main__":
    main()
