"""Experiments below the data root, found by listing: no path is ever made from what somebody asked."""

import os
import shutil
from pathlib import Path

from app.api.wire.problems import ApiError
from app.experiment.folder import Experiment, finished, interrupted, open_experiment

SETTINGS = "experiment.toml"


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
        self._known: dict[str, tuple[int, Experiment]] = {}

    def all(self) -> list[Path]:
        """Return the experiments' folders, newest first; one that is still being made is hidden."""
        found = (path.parent for path in self.root.glob(f"[!.]*/{SETTINGS}"))
        return sorted(found, key=lambda folder: folder.name, reverse=True)

    def folder(self, experiment: str) -> Path:
        """Return an experiment's folder. Raises ApiError when there is none."""
        found = child(self.root, experiment)
        if found is None or not (found / SETTINGS).is_file():
            raise ApiError("not_found", f"There is no experiment {experiment!r}.")
        return found

    def open(self, experiment: str) -> Experiment:
        """Return an experiment. Raises ApiError when there is none."""
        folder = self.folder(experiment)
        written_ns = (folder / SETTINGS).stat().st_mtime_ns
        known = self._known.get(experiment)
        if known is None or known[0] != written_ns:
            # Bounded by the number of experiments; an old entry is replaced when its file is written.
            known = self._known[experiment] = (written_ns, open_experiment(folder))
        return known[1]

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
        hidden = folder.with_name(f".removed-{folder.name}")
        folder.rename(hidden)
        shutil.rmtree(hidden)

    def items(self, experiment: str, kind: str) -> tuple[list[Path], list[Path]]:
        """Return the finished and the interrupted captures or results, newest first."""
        parent = self.folder(experiment) / f"{kind}s"
        shown = [folder for folder in interrupted(parent) if not folder.name.startswith(".")]
        # Names tell seconds only; two short captures may share one.
        done = sorted(finished(parent), key=lambda p: (p / "manifest.json").stat().st_mtime_ns, reverse=True)
        return done, shown[::-1]
