"""Experiments below the data root, found by listing: no path is ever made from what somebody asked."""

import contextlib
import os
import shutil
from pathlib import Path

from app.api.wire.problems import ApiError
from app.experiment.folder import (
    SETTINGS_FILE,
    Experiment,
    finished,
    interrupted,
    parse_experiment,
    revision_of,
)
from app.files.durable import temporary_name
from app.files.lock import locked
from app.files.reading import reading


def child(parent: Path, name: str) -> Path | None:
    """Return the folder in `parent` whose name is `name`, compared whole; links are not followed."""
    try:
        with os.scandir(parent) as entries:
            for entry in entries:
                if entry.name == name and entry.is_dir(follow_symlinks=False):
                    return Path(entry.path)
    except FileNotFoundError:
        return None
    return None


class Folders:
    """The experiments of one service."""

    def __init__(self, data_root: Path) -> None:
        self.root = data_root / "experiments"
        self.root.mkdir(parents=True, exist_ok=True)
        self._known: dict[str, Experiment] = {}

    def all(self) -> list[Path]:
        """Return the experiments' folders, newest first; one that is still being made is hidden."""
        found = (path.parent for path in self.root.glob(f"[!.]*/{SETTINGS_FILE}"))
        return sorted(found, key=lambda folder: folder.name, reverse=True)

    def locked(self, experiment: str) -> contextlib.AbstractContextManager[None]:
        """Hold the lock of an experiment while its files are read, changed and written back."""
        return locked(self.folder(experiment))

    def folder(self, experiment: str) -> Path:
        """Return an experiment's folder. Raises ApiError when there is none."""
        found = child(self.root, experiment)
        if found is None or not (found / SETTINGS_FILE).is_file():
            raise ApiError("not_found", f"There is no experiment {experiment!r}.")
        return found

    def open(self, experiment: str) -> Experiment:
        """Return an experiment. Raises ApiError when there is none."""
        folder = self.folder(experiment)
        with reading(folder / SETTINGS_FILE, "Correct the file."):
            content = (folder / SETTINGS_FILE).read_bytes()
        known = self._known.get(experiment)
        if known is None or known.revision != revision_of(content):
            # Bounded by the number of experiments; an old entry is replaced when its file is written.
            known = self._known[experiment] = parse_experiment(folder, content)
        return known

    def item(self, experiment: str, kind: str, name: str) -> Path:
        """Return the folder of a finished capture or result. Raises ApiError."""
        found = child(self.folder(experiment) / f"{kind}s", name)
        if found is None:
            raise ApiError("not_found", f"Experiment {experiment!r} has no {kind} {name!r}.")
        if found in interrupted(found.parent):
            raise ApiError(
                "conflict", f"The {kind} {name!r} was interrupted: it has no manifest.", "Discard it."
            )
        return found

    def remove(self, folder: Path) -> None:
        """Remove a capture or result: first out of sight, so that a half-removed one is never used."""
        hidden = temporary_name(folder)
        folder.rename(hidden)
        shutil.rmtree(hidden)

    def items(self, experiment: str, kind: str) -> tuple[list[Path], list[Path]]:
        """Return the finished and the interrupted captures or results, newest first."""
        parent = self.folder(experiment) / f"{kind}s"
        shown = [folder for folder in interrupted(parent) if not folder.name.startswith(".")]
        # Names tell seconds only; two short captures may share one.
        return sorted(finished(parent), key=_written_ns, reverse=True), shown[::-1]


def shown_name(folder: Path) -> str:
    """A folder's name as text; one that somebody gave bytes that are no text is shown with marks."""
    return os.fsencode(folder.name).decode("utf-8", "replace")


def _written_ns(folder: Path) -> int:
    with contextlib.suppress(OSError):  # removed since it was listed
        return (folder / "manifest.json").stat().st_mtime_ns
    return 0
