"""Cut the power at random moments of a story of jobs and captures; count the promises that were broken.

    python -m tests.benchmarks.power_cut --cuts 200

Prints one JSON line; `losses` must be empty.
"""

import argparse
import json
import random
import tempfile
from pathlib import Path

from tests.powercut.story import losses_after_cut, promises, record, specs, undisturbed


def main() -> None:
    """Parse the options and print the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=4)
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    wanted, chance, losses = specs(options.jobs, options.trials), random.Random(options.seed), []
    kept = dict.fromkeys(("job", "capture", "step", "result"), 0)
    with tempfile.TemporaryDirectory() as name:
        expected = undisturbed(Path(name) / "undisturbed", wanted)
        trace = record(Path(name), wanted)
        for _ in range(options.cuts):
            at, seed = chance.randint(0, len(trace)), chance.randint(0, 1 << 32)
            for kind, told in promises([dict(change) for change in trace[:at]]).items():
                kept[kind] += len(told)
            losses += [(at, loss) for loss in losses_after_cut(trace, at, seed, expected)]
    flushes = sum(change["op"].startswith("fsync") for change in trace)
    story = {"cuts": options.cuts, "changes": len(trace), "flushes": flushes, "promises_checked": kept}
    print(json.dumps(story | {"losses": losses}))


if __name__ == "__main__":
    main()
