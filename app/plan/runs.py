"""The finished runs of this machine, a JSON line each beside its figures: promises are learned from them.

Any number of programs write at a time; a line that was cut off, or that another version wrote, is passed over.
Where the folder cannot be written there are no runs, and nothing is said of it: a promise is a convenience.
"""

import contextlib
import os
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from app.errors import AirlensError
from app.files.durable import make_folder, write_text
from app.files.lock import locked
from app.files.toml import Strict
from app.plan.machine import machine_path

# Newest runs that are kept. The file grows to twice as many before it is cut: it is seldom rewritten.
KEPT = 300
_WAIT_S = 2.0
_Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Run(Strict):
    """One finished run: what it was, what its cost was counted from, and its seconds by stage.

    `programs` and `scene` tell runs apart (`app.plan.task`); `folder` keeps the compiled programs, and `warm` says
    whether most were found there, null where none was needed. `work` is null where nobody had counted it.
    """

    at: str
    preset: str
    programs: str
    scene: str
    folder: str
    warm: bool | None
    pixels: _Amount
    work: _Amount | None
    seconds: dict[str, _Amount]


def runs_path() -> Path:
    """Where the runs are kept."""
    return machine_path().with_name("runs.jsonl")


def kept_runs(path: Path | None = None) -> tuple[Run, ...]:
    """The runs in their order, oldest first; none where there is no file that can be read."""
    try:
        text = (path or runs_path()).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    return tuple(run for run in map(_run, text.splitlines()) if run is not None)


def keep_run(run: Run, path: Path | None = None) -> None:
    """Append a run durably, and let go of the oldest. Never raises for a folder that cannot be written."""
    path = path or runs_path()
    with contextlib.suppress(OSError, AirlensError):
        make_folder(path.parent)
        with locked(path.parent, _WAIT_S):
            _append(path, run.model_dump_json() + "\n")
            _cut(path)


def _append(path: Path, line: str) -> None:
    with open(path, "a+b") as file:
        # What a killed writer began is ended, so that it does not spoil this line.
        if file.tell() > 0:
            file.seek(-1, os.SEEK_END)
            line = line if file.read() == b"\n" else f"\n{line}"
        file.write(line.encode())
        file.flush()
        os.fsync(file.fileno())


def _cut(path: Path) -> None:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    if len(lines) > 2 * KEPT:
        write_text(path, "".join(line + "\n" for line in lines[-KEPT:]))


def _run(line: str) -> Run | None:
    try:
        return Run.model_validate_json(line)
    except ValidationError:
        return None
