"""How many points of rooms with a known truth lie within their 95 % intervals, over noise seeds.

The seed changes only the shifts: the coarse room that is marched as stated, and its derivatives, serve
all seeds of a room and a level of information. One JSON line each, with the errors beside it.

    python -m tests.benchmarks.coverage A.npz C.npz --seeds 0 --cells 48 --coarse 32
    python -m tests.benchmarks.coverage A.npz C.npz --seeds 0 1 2 3 4
"""

import argparse
import json
import time
from pathlib import Path

from app.benches.room_fit import coverage, problem_of
from app.score import score_solution
from core.solve.room import RoomSettings, begin, finish


def main() -> None:
    """Rows for every room, level and seed, then the shares over all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path, nargs="+")
    parser.add_argument("--information", nargs="+", default=["surveyed", "operator"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--cells", type=int, default=48)
    parser.add_argument("--coarse", type=int, default=32)
    options = parser.parse_args()
    settings = RoomSettings(cells=options.cells, coarse_cells=options.coarse)
    for path in options.truth:
        for information in options.information:
            began_s, begun = time.process_time(), None
            for seed in options.seeds:
                problem, volume = problem_of(path, information, "texture", "paper", seed)
                begun = begun or begin(problem, settings, lambda _: None)
                found = finish(begun, problem, settings, lambda _: None, start_s=time.perf_counter())
                scores = score_solution(found, volume)
                row = {"truth": path.stem, "information": information, "seed": seed, "cells": options.cells}
                row |= {"u_rel": scores["u"]["rel"], "T_rms_k": scores["T"]["rms_K"]}
                row |= {"T_departure": scores["T"]["departure_of_departures"], **coverage(found, volume)}
                row["cpu_s"] = time.process_time() - began_s
                began_s = time.process_time()
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
