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
from pathlib import Path

from app.bench.room_fit import problem_of
from app.reconstruct.problem import with_scene
from app.volume.misread import misread
from app.volume.score import coverage, score_solution
from core.estimate.marches import Marches
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
                    problem, background = with_scene(problem, misread(problem.scene, seed)), None
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


if __name__ == "__main__":
    main()
