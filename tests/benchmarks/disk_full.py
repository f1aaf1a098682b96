"""Let the disk be full at random writes of a run, free it, and see that all goes on to the same result.

    python -m tests.benchmarks.disk_full --points 30

Prints one JSON line a point: the error that was told, and whether anything was damaged or differs.
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
        for n in range(options.points):
            folder, at = Path(name) / str(n), chance.randrange(writes)
            folder.mkdir()
            with mounted(folder) as (mount, _):
                lived = live_on_a_full_disk(mount, wanted, at)
            record = {"full_after": at, "of_writes": writes, "told": lived["told"][:1]}
            verdict = {"damaged": lived["damage"], "equal": lived["results"] == expected}
            print(json.dumps(record | verdict), flush=True)


def _writes_of_a_run(folder: Path, wanted: list) -> int:
    folder.mkdir()
    with mounted(folder) as (mount, trace):
        live_on_a_full_disk(mount, wanted, 1 << 30)
    return sum(change["op"] == "write" for change in read_trace(trace))


if __name__ == "__main__":
    main()
