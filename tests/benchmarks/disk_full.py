"""Let the disk be full at random writes of a run, free it, and see that all goes on to the same result.

    python -m tests.benchmarks.disk_full --points 30

Prints one JSON line: at how many points an error was told, and what was damaged or differed (must be 0).
"""

import argparse
import json
import random
import tempfile
from pathlib import Path

from tests.powercut.crash import read_trace
from tests.powercut.story import live_on_a_full_disk, mounted, specs, undisturbed


def main() -> None:
    """Parse the options and print the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    wanted, chance = specs(2, 300), random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        expected = undisturbed(Path(name) / "undisturbed", wanted)
        writes = _writes_of_a_run(Path(name) / "whole", wanted)
        told, damaged, differing = 0, 0, 0
        for n in range(options.points):
            folder = Path(name) / str(n)
            folder.mkdir()
            with mounted(folder) as (mount, _):
                lived = live_on_a_full_disk(mount, wanted, chance.randrange(writes))
            told += bool(lived["told"])
            damaged += lived["damage"]
            differing += lived["results"] != expected
    record = {"points": options.points, "writes_of_a_run": writes, "told": told}
    print(json.dumps(record | {"damaged": damaged, "differing": differing}))


def _writes_of_a_run(folder: Path, wanted: list) -> int:
    folder.mkdir()
    with mounted(folder) as (mount, trace):
        live_on_a_full_disk(mount, wanted, 1 << 30)
    return sum(change["op"] == "write" for change in read_trace(trace))


if __name__ == "__main__":
    main()
