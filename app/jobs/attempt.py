"""What a running computation may do: read its order, write checkpoints, tell progress, notice a stop."""

import contextlib
import json
import math
import shutil
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from app.errors import BadInputError
from app.files.durable import make_folder, publish_folder, write_json
from app.jobs.folder import JobFolder, Owner

PLANE_FILE = "plane.npy"
SHOWN_EVERY_S = 1.0


class AttemptStoppedError(Exception):
    """The computation has written its checkpoint and ends, as it was asked to."""


@dataclass(frozen=True)
class Attempt:
    """One attempt at one job, as its computation sees it."""

    folder: JobFolder
    owner: Owner
    experiment: Path | None
    output: Path
    stop: threading.Event = field(default_factory=threading.Event)
    _shown: "_Pace" = field(default_factory=lambda: _Pace(SHOWN_EVERY_S))

    @property
    def checkpoints(self) -> Path:
        """The folder for checkpoints; it already holds those of the attempt before."""
        return self.folder.attempt(self.owner.attempt) / "checkpoint"

    def experiment_folder(self) -> Path:
        """Return the experiment's folder. Raises BadInputError when the job names none."""
        if self.experiment is None:
            raise BadInputError(f"Job {self.folder.path.name} names no experiment; submit it with one.")
        return self.experiment

    def tell(self, kind: str, body: Mapping[str, Any]) -> None:
        """Append an event. Not flushed to disk: progress is told, not promised."""
        line = json.dumps({"at_s": time.time(), "kind": kind, "body": dict(body)}, allow_nan=False)
        with open(self.folder.attempt(self.owner.attempt) / "events.jsonl", "a", encoding="utf-8") as file:
            file.write(line + "\n")

    def progress(self, step: int, steps: int, values: Mapping[str, float] | None = None) -> None:
        """Tell how far the computation is, with the values worth a curve."""
        finite = {name: value if math.isfinite(value) else None for name, value in (values or {}).items()}
        self.tell("progress", {"step": step, "steps": steps, **finite})

    def show(self, plane: Float32[np.ndarray, "across up"], *, last: bool = False) -> None:
        """Show how a field stands now; at most once a second but for the last, and not kept: told, not promised."""
        if self._shown.is_due() or last:
            path = self.folder.attempt(self.owner.attempt) / PLANE_FILE
            temporary = path.with_suffix(".tmp.npy")
            np.save(temporary, np.asarray(plane, np.float32))
            temporary.replace(path)

    def check_stop(self) -> None:
        """Raise AttemptStoppedError when the job was asked to stop. Call it after writing a checkpoint."""
        if self.stop.is_set():
            raise AttemptStoppedError


class _Pace:
    """Says when something is due again, by a clock that nobody sets."""

    def __init__(self, every_s: float) -> None:
        self._every_s, self._last_s = every_s, float("-inf")

    def is_due(self) -> bool:
        now_s = time.monotonic()
        if now_s - self._last_s < self._every_s:
            return False
        self._last_s = now_s
        return True


class CheckpointClock:
    """Says when a checkpoint is due: at least every minute, and never for more than 1 % of the time."""

    _LONGEST_S, _SHARE = 60.0, 0.01

    def __init__(self) -> None:
        self._last_s = time.monotonic()
        self._cost_s = 0.0

    def is_due(self) -> bool:
        """True when it is time for the next checkpoint."""
        pause_s = min(self._LONGEST_S, max(0.25, self._cost_s / self._SHARE))
        return time.monotonic() - self._last_s >= pause_s

    @contextlib.contextmanager
    def measure(self) -> Iterator[None]:
        """Measure what writing a checkpoint costs."""
        start_s = time.monotonic()
        yield
        self._last_s = time.monotonic()
        self._cost_s = self._last_s - start_s


def inherit_checkpoint(folder: JobFolder, number: int) -> None:
    """Copy the newest earlier checkpoint into this attempt's folder, whole or not at all.

    An older attempt may still be alive and writing: it never sees the copy. Leftovers are removed.
    """
    own = folder.attempt(number) / "checkpoint"
    for earlier in range(number - 1, 0, -1):
        source = folder.attempt(earlier) / "checkpoint"
        files = [path for path in _entries(source) if not path.name.startswith(".")]
        if files and not own.exists():
            copy = own.with_name(".checkpoint.tmp")
            shutil.rmtree(copy, ignore_errors=True)
            make_folder(copy)
            for path in files:
                shutil.copyfile(path, copy / path.name)
            publish_folder(copy, own)
        elif own.exists() and earlier < number - 1:
            shutil.rmtree(source, ignore_errors=True)
        shutil.rmtree(folder.staging(earlier), ignore_errors=True)
    make_folder(own)


def publish(attempt: Attempt, summary: Mapping[str, Any]) -> None:
    """Put the finished folder in place by one rename. Raises FencedError when replaced."""
    write_json(attempt.output / "result.json", {"summary": dict(summary)})
    with attempt.folder.locked():
        attempt.folder.check(attempt.owner)
        publish_folder(attempt.output, attempt.folder.target())


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_file())
    except FileNotFoundError:
        return []
