"""Kill supervisor and workers at random moments while jobs run; count what was lost, doubled or torn.

    python -m tests.benchmarks.chaos --kills 300 --jobs 20

Prints one JSON line. Every number after `kills` must be 0, and `equal` the number of jobs: each result is
compared bit by bit with a run of the same job that nobody disturbed.
"""

import argparse
import collections
import contextlib
import json
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil

from app import worker
from app.jobs import JobSpec, JobState, Ledger
from app.jobs.folder import JobFolder, Owner

CONFIG = """
devices = ["cpu:0", "cpu:1"]
max_losses = 100000
retry_first_s = 0.1
retry_longest_s = 0.5
memory_reserve_bytes = 0
poll_s = 0.1
"""


def specs(jobs: int, trials: int) -> list[JobSpec]:
    """Return as many studies, each with its own seed."""
    return [
        JobSpec(kind="noise-study", settings={"seed": n, "trials": trials}, memory_bytes=1 << 28)
        for n in range(jobs)
    ]


def undisturbed(folder: Path, wanted: list[JobSpec]) -> list[dict[str, bytes]]:
    """Return the files of each result, computed in this process without any interruption."""
    ledger = Ledger(folder)
    results = []
    for spec in wanted:
        job_folder = JobFolder(ledger.folder_of(ledger.submit(spec).id))
        owner = Owner(attempt=1, token="undisturbed")
        job_folder.hand_over(owner)
        worker.compute(job_folder, owner, threading.Event())
        results.append(files_of(job_folder.path / "result"))
    return results


def files_of(folder: Path) -> dict[str, bytes]:
    """Return name and content of every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


class Supervised:
    """The supervisor's process, started again whenever it is gone."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._log = open(folder / "supervisor.log", "ab")
        self._child: subprocess.Popen[bytes] | None = None

    def pid(self) -> int:
        """Return the process id, after starting the process again if need be."""
        if self._child is None or self._child.poll() is not None:
            command = [sys.executable, "-m", "app.jobs", str(self._folder)]
            self._child = subprocess.Popen(command, stdout=self._log, stderr=self._log)
        return self._child.pid

    def end(self) -> None:
        """Stop it as an operator would."""
        if self._child is not None:
            self._child.terminate()
            self._child.wait(20)
        self._log.close()


def workers_of(folder: Path) -> dict[int, str]:
    """Return the pid of every living worker below a folder, with its job."""
    found = {}
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.NoSuchProcess):
            command = process.cmdline()
            mine = "app.worker" in command and process.status() != psutil.STATUS_ZOMBIE
            place = Path(command[command.index("app.worker") + 1]) if mine else None
            if place is not None and place.parent == folder:
                found[process.pid] = place.name
    return found


def disturb(
    ledger: Ledger, wanted: list[JobSpec], kills: int, pause_s: float, seed: int, limit_s: float
) -> tuple[collections.Counter, list[str], float]:
    """Submit the jobs one by one and kill at random until all are done; return counts and the ids."""
    chance = random.Random(seed)
    counts: collections.Counter = collections.Counter()
    supervised = Supervised(ledger.folder)
    waiting, ids, start_s = list(enumerate(wanted)), [], time.monotonic()
    try:
        while time.monotonic() - start_s < limit_s:
            for _ in range(min(2, len(waiting))):
                n, spec = waiting.pop(0)
                ids.append(ledger.submit(spec, key=f"job-{n}").id)
            supervisor, living = supervised.pid(), workers_of(ledger.folder)
            doubled = collections.Counter(living.values())
            counts["workers_at_once"] = max([counts["workers_at_once"], len(living)])
            counts["jobs_seen_with_two_workers"] += sum(count > 1 for count in doubled.values())
            if not waiting and all(job.state is JobState.done for job in ledger.jobs()):
                break
            if sum(counts[name] for name in ("supervisor", "worker")) < kills:
                time.sleep(chance.expovariate(1 / pause_s))
                victim = chance.choice([*living, *living, supervisor])
                with contextlib.suppress(psutil.NoSuchProcess):
                    psutil.Process(victim).send_signal(signal.SIGKILL)
                    counts["supervisor" if victim == supervisor else "worker"] += 1
            else:
                time.sleep(0.2)
    finally:
        supervised.end()
    return counts, ids, time.monotonic() - start_s


def judge(ledger: Ledger, ids: list[str], expected: list[dict[str, bytes]]) -> dict[str, int]:
    """Count what should not be."""
    done = collections.Counter(e.job for e in _all_events(ledger) if e.body.get("state") == "done")
    results = [files_of(ledger.folder / job / "result") for job in ids]
    with contextlib.closing(sqlite3.connect(ledger.folder / "ledger.sqlite")) as database:
        damage = database.execute("PRAGMA integrity_check").fetchall() != [("ok",)]
    return {
        "lost": sum(ledger.get(job).state is not JobState.done for job in ids),
        "doubled": sum(done[job] != 1 for job in ids) + len(ledger.jobs()) - len(ids),
        "half_written": sum(not _is_whole(ledger.folder / job) for job in ids) + damage,
        "leftovers": sum(len(list((ledger.folder / job).glob(".*.tmp"))) for job in ids),
        "unequal": sum(a != b for a, b in zip(results, expected, strict=True)),
        "equal": sum(a == b for a, b in zip(results, expected, strict=True)),
        "attempts": sum(ledger.get(job).attempt for job in ids),
    }


def _is_whole(folder: Path) -> bool:
    """True when every JSON file below a job's folder can be read, leftovers of killed writes apart."""
    for path in folder.rglob("*.json"):
        with contextlib.suppress(FileNotFoundError):
            try:
                path.name.startswith(".") or json.loads(path.read_text())
            except ValueError:
                return False
    return True


def _all_events(ledger: Ledger):
    after = 0
    while found := ledger.events(after=after):
        yield from found
        after = found[-1].id


def chaos(
    folder: Path, *, jobs: int, kills: int, trials: int, pause_s: float, seed: int, limit_s: float
) -> dict:
    """Run the whole story; return the counts."""
    wanted = specs(jobs, trials)
    expected = undisturbed(folder / "undisturbed", wanted)
    ledger = Ledger(folder / "jobs")
    (ledger.folder / "jobs.toml").write_text(CONFIG)
    counts, ids, wall_s = disturb(ledger, wanted, kills, pause_s, seed, limit_s)
    killed = counts.pop("supervisor", 0), counts.pop("worker", 0)
    record = {"jobs": len(ids), "kills": sum(killed), "supervisor": killed[0], "workers": killed[1]}
    return record | judge(ledger, ids, expected) | counts | {"wall_s": round(wall_s, 1)}


def main() -> None:
    """Parse the options and print the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=20)
    parser.add_argument("--trials", type=int, default=3000)
    parser.add_argument("--pause-s", type=float, default=2.0, help="mean pause between kills")
    parser.add_argument("--limit-s", type=float, default=1800.0)
    parser.add_argument("--seed", type=int, default=0)
    options = vars(parser.parse_args())
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(chaos(Path(folder).resolve(), **options)))


if __name__ == "__main__":
    main()
