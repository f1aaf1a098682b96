"""A room that was measured: the room solver against Restivo's ventilated room (Annex 20's two-dimensional test case).

9 x 3 x 3 m, air of one temperature from a slot below the ceiling (0.168 m, 0.455 m/s: Reynolds number 5000), out by
a slot above the floor of the far wall (0.48 m). Measured by laser Doppler velocimetry: the mean velocity along x on
four lines in the middle plane. Air of one temperature bends no light, so nothing is fitted: this is the forward model
alone. One JSON line a closure: rms difference over the rms of what was measured, on each line and on all.

    python -m tests.benchmarks.measured_room --cells 48

Sources: A. Restivo, Turbulent Flow in Ventilated Rooms, PhD thesis, Imperial College London, 1979; P. V. Nielsen,
Specification of a Two-Dimensional Test Case, Annex 20, Aalborg University, 1990. The values, scaled to a room of 3 m,
are those in the validation suite of the Fire Dynamics Simulator (NIST, public domain: Restivo_Experiment).
"""

import argparse
import json
import time
from typing import Any

import numpy as np

from core.estimate.observation import sample
from core.estimate.prior import room_prior
from core.geometry import WALLS, Box, looking_along_y
from core.problem import Problem
from core.room.forward import carried_over, room, room_fields
from core.room.march import MarchSettings, march
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall
from tests.benchmarks.options import whole_numbers

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(9.0, 3.0, 3.0))
SUPPLY_M_S = 0.455
_MIDDLE_M = 1.5
# From rest, and on the finer grid: the air is changed once in 350 s.
_SETTLE_S, _REFINE_S = 700.0, 300.0

# Place [m] and mean velocity along x [m/s]: along x half a slot's height from floor and ceiling, and upwards at two.
MEASURED = {
    "floor": """0.150 0.0171 0.296 0.0230 0.472 0.0209 0.645 0.0171 0.775 0.0141 0.948 0.00807 1.11 0.00378
        1.30 -0.00152 1.45 -0.00782 1.62 -0.0106 1.79 -0.0131 1.95 -0.0192 2.28 -0.0282 2.65 -0.0328 2.98 -0.0449
        3.47 -0.0615 4.00 -0.0810 4.47 -0.0953 4.97 -0.120 5.54 -0.144 6.02 -0.153 6.50 -0.154 7.02 -0.145
        7.55 -0.123 8.06 -0.0807 8.40 -0.0338 8.71 0.0265 8.92 0.0989""",
    "ceiling": """0.0399 0.490 0.516 0.483 1.00 0.470 1.49 0.444 2.00 0.417 2.51 0.393 3.01 0.374 3.47 0.357
        3.99 0.339 4.49 0.325 5.03 0.313 5.53 0.301 6.00 0.291 6.51 0.278 6.89 0.268 7.21 0.255 7.54 0.229
        7.90 0.204 8.05 0.174 8.13 0.139 8.18 0.109 8.27 0.0652 8.39 0.0295 8.45 -0.0121 8.52 -0.0637
        8.59 -0.0929 8.67 -0.0896 8.78 -0.0708""",
    "x = 3 m": """0.0383 -0.0435 0.0901 -0.0485 0.142 -0.0505 0.205 -0.0513 0.272 -0.0533 0.339 -0.0538 0.414 -0.0525
        0.500 -0.0525 0.617 -0.0498 0.832 -0.0465 1.04 -0.0430 1.25 -0.0318 1.48 -0.0183 1.73 -0.00175 1.91 0.0150
        2.13 0.0353 2.34 0.0743 2.44 0.106 2.56 0.155 2.67 0.231 2.74 0.287 2.77 0.315 2.81 0.344 2.88 0.358
        2.93 0.351""",
    "x = 6 m": """0.0684 -0.138 0.110 -0.144 0.155 -0.143 0.222 -0.139 0.287 -0.134 0.348 -0.130 0.435 -0.126
        0.531 -0.120 0.660 -0.112 0.864 -0.0969 1.07 -0.0714 1.29 -0.0390 1.50 -0.0139 1.73 0.0172 1.94 0.0412
        2.15 0.0801 2.36 0.135 2.50 0.181 2.63 0.222 2.71 0.246 2.80 0.274 2.84 0.285 2.89 0.286 2.94 0.283
        2.98 0.264""",
}


def scene() -> Scene:
    """The room as its authors state it; no wall passes heat."""
    camera = looking_along_y(position_m=(4.5, -8.0, 1.5), width_px=200, height_px=100, focal_px=150.0)
    return Scene(
        room=ROOM,
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(
            Inlet(
                patch=Patch(wall="x_min", lower_m=(0.0, 2.832), upper_m=(3.0, 3.0)),
                temperature_k=293.15,
                velocity_m_s=(SUPPLY_M_S, 0.0, 0.0),
                turbulence_intensity=0.04,
            ),
            Outlet(patch=Patch(wall="x_max", lower_m=(0.0, 0.0), upper_m=(3.0, 0.48))),
            *(Wall(wall=wall, thermal="adiabatic") for wall in WALLS),
        ),
    )


def line(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Points (points x 3) [m] of a measured line, and the velocity along x there [m/s]."""
    place_m, velocity_m_s = np.array(MEASURED[name].split(), float).reshape(-1, 2).T
    middle = np.full(len(place_m), _MIDDLE_M)
    if name in ("floor", "ceiling"):
        height = np.full(len(place_m), 0.084 if name == "floor" else 3.0 - 0.084)
        return np.stack([place_m, middle, height], -1), velocity_m_s
    along = np.full(len(place_m), float(name.split()[2]))
    return np.stack([along, middle, place_m], -1), velocity_m_s


def row(closure: str, cells: int) -> dict[str, Any]:
    """March the room and compare."""
    began_s = time.process_time()
    coarse, fine = (room(scene(), n, closure) for n in (min(32, cells), cells))
    parameters = room_prior(Problem(scene(), (), ()), coarse.layout).mean
    model = coarse.model(parameters)
    start = coarse.at_rest(model, np.zeros(coarse.grid.cells[2]))
    first = march(start, model, MarchSettings(longest_s=_SETTLE_S, tolerance=0.004))
    model = fine.model(parameters)
    last = march(
        carried_over(first.last, coarse.grid, fine.grid),
        model,
        MarchSettings(longest_s=_REFINE_S, tolerance=0.004),
    )
    nx, ny, nz = (n + 1 for n in fine.grid.cells)
    found = room_fields(last.mean, model, fine.layout, (nx, ny, nz)).velocity_m_s[..., 0]
    shown = {name: (sample(found, line(name)[0], ROOM), line(name)[1]) for name in MEASURED}
    every = tuple(np.concatenate(parts) for parts in zip(*shown.values(), strict=True))
    return {
        "closure": closure,
        "cells": list(fine.grid.cells),
        **{name: round(_apart(*pair), 3) for name, pair in shown.items()},
        "all": round(_apart(*every), 3),
        "return flow, largest": [round(float(pair.min()), 3) for pair in shown["floor"]],
        "change": round(last.change, 4),
        "outcome": last.outcome.name,
        "cpu_s": round(time.process_time() - began_s, 1),
    }


def _apart(found: np.ndarray, measured: np.ndarray) -> float:
    return float(np.sqrt(np.mean((found - measured) ** 2) / np.mean(measured**2)))


def main() -> None:
    """Print one JSON line a closure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    whole_numbers(parser, cells=48)
    options = parser.parse_args()
    for closure in ("k_epsilon", "zero_equation"):
        print(json.dumps(row(closure, options.cells)), flush=True)


if __name__ == "__main__":
    main()
