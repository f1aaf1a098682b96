"""Walk a service through its states with faults at every step; print the counts as one JSON line.

    python -m tests.benchmarks.walks --walks 2000 --steps 30 --seed 0

A walk that ends in a state without a way out, or that lost what was acknowledged, is printed and ends the run.
"""

import argparse
import json
import logging
import random
import time

from hypothesis import Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.walks.faults import silent_deaths
from tests.walks.test_walks import QUIET
from tests.walks.walk import TALLY, Walk


@silent_deaths()
def main() -> None:
    """Parse the options and print the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--walks", type=int, default=2000)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    began_s, cpu_s, number = time.monotonic(), time.process_time(), random.Random(options.seed)
    # In portions: so many walks at once are drawn ever more alike.
    while TALLY["walks"] < options.walks:
        portion = min(50, options.walks - TALLY["walks"])
        how = settings(
            max_examples=portion, stateful_step_count=options.steps, phases=(Phase.generate,), **QUIET
        )
        run_state_machine_as_test(seed(number.getrandbits(32))(type("Walk", (Walk,), {})), settings=how)
    record = {
        "walks": TALLY.pop("walks"),
        "steps": options.steps,
        "seed": options.seed,
        "stuck": 0,
        "lost": 0,
    }
    spent = {
        "cpu_s": round(time.process_time() - cpu_s, 1),
        "wall_s": round(time.monotonic() - began_s, 1),
    }
    print(json.dumps(record | spent | {"counts": dict(sorted(TALLY.items()))}))


if __name__ == "__main__":
    main()
