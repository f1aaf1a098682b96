"""How many points of rooms with a known truth lie within their 95 % intervals, over noise seeds.

The seed changes the shifts' noise and, with `--misread`, what was read at the rig: supplies, thermometers
and walls are entered as wrong as their stated deviations say. Without it they are exact, a luck that no
operator has, and intervals that allow for misreadings look too wide. One JSON line each, with the errors
beside it.

    python -m tests.benchmarks.coverage A.npz C.npz --seeds 0 --cells 48 --coarse 32
    python -m tests.benchmarks.coverage A.npz C.npz --misread --seeds 0 1 2 3 4
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.bench.room_fit import coverage, problem_of
from app.reconstruct.problem import with_scene
from app.volume.score import score_solution
from core.estimate.marches import Marches
from core.problem import Problem
from core.scene import BoundaryInformation, Heater, Inlet, Outlet, Wall
from core.solve.room import RoomSettings, analyse, background_of


def main() -> None:
    """Rows for every room, level and seed, then the shares over all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path, nargs="+")
    parser.add_argument("--information", nargs="+", default=["surveyed", "operator"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--cells", type=int, default=48)
    parser.add_argument("--coarse", type=int, default=32)
    parser.add_argument("--misread", action="store_true")
    options = parser.parse_args()
    settings = RoomSettings(cells=options.cells, coarse_cells=options.coarse)
    for path in options.truth:
        for information in options.information:
            began_s, background = time.process_time(), None
            for seed in options.seeds:
                problem, volume = problem_of(path, information, "texture", "paper", seed)
                if options.misread:
                    problem, background = misread(problem, seed), None
                # Without misreadings the coarse room as stated, and its derivatives, serve all seeds.
                background = background or background_of(problem, settings, Marches())
                found = analyse(background, problem, settings, Marches())
                scores = score_solution(found, volume)
                row = {"truth": path.stem, "information": information, "seed": seed, "cells": options.cells}
                row |= {
                    "misread": options.misread,
                    "u_rel": scores["u"]["rel"],
                    "T_rms_k": scores["T"]["rms_K"],
                }
                row |= {"T_departure": scores["T"]["departure_of_departures"], **coverage(found, volume)}
                row["cpu_s"] = time.process_time() - began_s
                began_s = time.process_time()
                print(json.dumps(row), flush=True)


def misread(problem: Problem, seed: int) -> Problem:
    """The problem with every stated temperature and supply off by a draw of its stated deviation."""
    draw = np.random.default_rng(1000 + seed).standard_normal

    def read(item: BoundaryInformation) -> BoundaryInformation:
        if isinstance(item, Inlet):
            speed_m_s = float(np.linalg.norm(item.velocity_m_s))
            factor = 1.0 + item.velocity_std_m_s / speed_m_s * float(draw())
            x, y, z = (factor * v for v in item.velocity_m_s)
            warmer_k = item.temperature_std_k * float(draw())
            return replace(item, temperature_k=item.temperature_k + warmer_k, velocity_m_s=(x, y, z))
        if isinstance(item, Outlet) and item.mean_temperature_k is not None:
            warmer_k = item.temperature_std_k * float(draw())
            return replace(item, mean_temperature_k=item.mean_temperature_k + warmer_k)
        if isinstance(item, Wall | Heater) and item.temperature_k is not None:
            return replace(item, temperature_k=item.temperature_k + item.temperature_std_k * float(draw()))
        return item

    scene = replace(problem.scene, boundary=tuple(read(item) for item in problem.scene.boundary))
    return with_scene(problem, scene)


if __name__ == "__main__":
    main()
