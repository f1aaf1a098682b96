"""Kill supervisor, workers and service at random while jobs run; count what was lost, doubled or torn.

    python -m tests.benchmarks.chaos --kills 300 --jobs 20 [--web]

Prints one JSON line. `lost` to `unequal` must be 0, and `equal` the number of jobs: each result is
compared bit by bit with a run of the same job that nobody disturbed, which is made first. The jobs come one
by one over all the kills (the next when its share of them has been made), so that they end in between, also
on one core; `ended_during_kills` says how many did.
"""

import argparse
import collections
import contextlib
import json
import multiprocessing
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import httpx
import psutil

from app import worker
from app.errors import AirlensError
from app.jobs import JobSpec, JobState, Ledger
from app.jobs.folder import JobFolder, Owner

# After the last kill, so that what is counted as lost really is.
GRACE_S = 900.0
ROLES = ("supervisor", "worker", "web")
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


class Kept:
    """A process that is started again whenever it is gone, as a service manager would."""

    def __init__(self, command: list[str], log: Path, port: int | None = None) -> None:
        self._command, self._log, self._port = command, open(log, "ab"), port
        self._child: subprocess.Popen[bytes] | None = None

    def pid(self) -> int:
        """Return the process id, after starting the process again if need be."""
        if self._child is None or self._child.poll() is not None:
            self._child = subprocess.Popen(self._command, stdout=self._log, stderr=self._log)
        return self._child.pid

    def is_up(self) -> bool:
        """True while the process runs and, if it has a port, accepts connections there."""
        if self._child is None or self._child.poll() is not None:
            return False
        if self._port is None:
            return True
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port), 0.2):
            return True
        return False

    def end(self) -> None:
        """Stop it as an operator would."""
        if self._child is not None:
            self._child.terminate()
            self._child.wait(30)
        self._log.close()


def living(folder: Path) -> dict[int, tuple[str, str]]:
    """Return the pid of every supervisor and worker below a folder, with its role and its job."""
    found = {}
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.NoSuchProcess, IndexError):
            command = process.cmdline()
            role = next((name for name in ("app.worker", "app.jobs") if name in command), None)
            if role is None or process.status() == psutil.STATUS_ZOMBIE:
                continue
            place = Path(command[command.index(role) + 1])
            if role == "app.worker" and place.parent == folder:
                found[process.pid] = ("worker", place.name)
            elif role == "app.jobs" and place == folder:
                found[process.pid] = ("supervisor", "")
    return found


Submit = Callable[[str, JobSpec], str]


def disturb(
    ledger: Ledger,
    wanted: list[JobSpec],
    kept: Kept,
    submit: Submit,
    *,
    kills: int,
    pause_s: float,
    seed: int,
    limit_s: float,
) -> tuple[collections.Counter, dict[int, str], float]:
    """Submit the jobs over the kills and wait until all are done; return counts, ids by number, wall time."""
    chance = random.Random(seed)
    counts: collections.Counter = collections.Counter()
    waiting, start_s = list(enumerate(wanted)), time.monotonic()
    ids: dict[int, str] = {}
    try:
        while time.monotonic() - start_s < limit_s + GRACE_S:
            owner, killed = kept.pid(), sum(counts[name] for name in ROLES)
            killing = killed < kills and time.monotonic() - start_s < limit_s
            for n, spec in waiting[:2]:
                if killing and (n - 1) * kills > killed * len(wanted):  # one waits while one runs
                    break
                with contextlib.suppress(AirlensError, httpx.HTTPError, OSError):
                    ids[n] = submit(f"chaos-job-{n}", spec)
                    waiting.remove((n, spec))
            _observe(counts, living(ledger.folder))
            ended = sum(job.state is JobState.done for job in ledger.jobs())
            if killing:
                counts["ended_during_kills"] = ended
                time.sleep(chance.expovariate(1 / pause_s))
                alive = living(ledger.folder)  # looked up again: only what lives can be killed
                # A service that is killed before it is up would never take the jobs.
                if owner not in alive and kept.is_up():
                    alive[owner] = ("web", "")
                _kill_one(chance, alive, counts)
            elif ended == len(wanted):
                break
            else:
                time.sleep(0.2)
    finally:
        kept.end()
    counts["never_taken"] = len(waiting)
    return counts, ids, time.monotonic() - start_s


def _observe(counts: collections.Counter, alive: dict[int, tuple[str, str]]) -> None:
    jobs = collections.Counter(job for role, job in alive.values() if role == "worker")
    counts["workers_at_once"] = max(counts["workers_at_once"], sum(jobs.values()))
    counts["jobs_seen_with_two_workers"] += sum(count > 1 for count in jobs.values())


def _kill_one(chance: random.Random, alive: dict[int, tuple[str, str]], counts: collections.Counter) -> None:
    """Kill a process; a worker twice as likely as any other."""
    if not alive:
        return
    victim = chance.choice([pid for pid, (role, _) in alive.items() for _ in range(1 + (role == "worker"))])
    with contextlib.suppress(psutil.NoSuchProcess):
        psutil.Process(victim).send_signal(signal.SIGKILL)
        counts[alive[victim][0]] += 1


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
    folder: Path,
    *,
    jobs: int,
    kills: int,
    trials: int,
    pause_s: float,
    seed: int,
    limit_s: float,
    web: bool = False,
) -> dict:
    """Run the whole story; return the counts."""
    wanted = specs(jobs, trials)
    # In a process of its own: its exit frees what the array library holds.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        expected = pool.submit(undisturbed, folder / "undisturbed", wanted).result()
    ledger = Ledger(folder / "jobs")
    (ledger.folder / "jobs.toml").write_text(CONFIG)
    kept, submit = by_service(folder) if web else by_ledger(ledger)
    chaotic = {"kills": kills, "pause_s": pause_s, "seed": seed, "limit_s": limit_s}
    counts, ids, wall_s = disturb(ledger, wanted, kept, submit, **chaotic)
    killed = {role: counts.pop(role, 0) for role in ROLES}
    record = {"jobs": len(ids), "kills": sum(killed.values()), **killed}
    verdict = judge(ledger, list(ids.values()), [expected[n] for n in ids])
    return record | verdict | counts | {"wall_s": round(wall_s, 1)}


def by_ledger(ledger: Ledger) -> tuple[Kept, Submit]:
    """Submit to the ledger itself; the supervisor is what is kept alive."""
    kept = Kept([sys.executable, "-m", "app.jobs", str(ledger.folder)], ledger.folder / "supervisor.log")
    return kept, lambda key, spec: ledger.submit(spec, key=key).id


def by_service(folder: Path) -> tuple[Kept, Submit]:
    """Submit over HTTP to `airlens serve`, which is what is kept alive; it attends to the supervisor."""
    from app.client import Client

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    program = [sys.executable, "-c", "from app.cli import main; main()"]
    kept = Kept([*program, "serve", str(folder), "--port", str(port)], folder / "serve.log", port)

    def submit(key: str, spec: JobSpec) -> str:
        token = (folder / "service" / "token").read_text().strip()
        with Client(f"http://127.0.0.1:{port}", token, timeout_s=10.0) as client:
            return client.submit_job(spec.kind, dict(spec.settings), key=key).job

    return kept, submit


def main() -> None:
    """Parse the options and print the record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=20)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--pause-s", type=float, default=4.0, help="mean pause between kills")
    parser.add_argument("--limit-s", type=float, default=1800.0, help="no kills after that")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--web", action="store_true", help="submit to airlens serve, and kill that too")
    options = vars(parser.parse_args())
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(chaos(Path(folder).resolve(), **options)))


if __name__ == "__main__":
    main()
