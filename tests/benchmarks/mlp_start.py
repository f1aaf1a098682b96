"""What the paper's losses make of a good start: the network from nothing, and from a marched room.

One JSON line for the room itself, for the network that imitates it (no step of the losses), and for the
network after `--steps` of the paper's three losses from each start.

    python -m tests.benchmarks.mlp_start A.npz --steps 300 --cells 32 --coarse 24
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

from app.bench.room_fit import problem_of
from app.volume.file import RoomVolume
from app.volume.score import score_solution
from core.mlp import MlpSettings
from core.result import Solution
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings, solve_mlp
from core.solve.room import RoomSettings, solve_room
from tests.benchmarks.options import whole_numbers


def row(name: str, found: Solution, volume: RoomVolume, cpu_s: float) -> dict[str, Any]:
    """Errors beside the cost."""
    scores = score_solution(found, volume)
    return {
        "start": name,
        "u_rel": scores["u"]["rel"],
        "T_rms_k": scores["T"]["rms_K"],
        "T_departure": scores["T"]["departure_of_departures"],
        "p_departure": scores["p"]["rel_departure"],
        "cpu_s": round(cpu_s, 1),
        "outcome": found.outcome.name,
    }


def main() -> None:
    """Four rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--information", default="surveyed")
    whole_numbers(parser, steps=300, width=128, batch=2048, cells=32, coarse=24)
    options = parser.parse_args()
    problem, volume = problem_of(options.truth, options.information, "texture", "paper", 0)
    began_s = time.process_time()
    room = solve_room(problem, RoomSettings(cells=options.cells, coarse_cells=options.coarse))
    print(json.dumps(row("room", room, volume, time.process_time() - began_s)), flush=True)
    share = options.batch / 8192
    for name, start, steps in (
        ("network like the room", room, 1),
        ("network from nothing", None, options.steps),
        ("network from the room", room, options.steps),
    ):
        settings = MlpSolveSettings(
            network=MlpSettings(width=options.width),
            collocation_points=options.batch,
            pixels=round(5000 * share),
            boundary_points=round(4096 * share),
            loop=LoopSettings(steps=steps),
        )
        began_s = time.process_time()
        found = solve_mlp(problem, settings, start=start)
        cpu_s = time.process_time() - began_s
        print(json.dumps({"steps": steps, **row(name, found, volume, cpu_s)}), flush=True)


if __name__ == "__main__":
    main()
