"""An experiment is a folder. What lies in it:

    experiment.toml            rig and scene
    answers.toml               the answers that `airlens new` made these from, if it did
    boundary/                  files that the scene names: known planes, sensors
    plan.json                  what `airlens plan` said last
    calibration/               bundle.json: models, with units, date, quality; record-<camera>.json: what they are of
    captures/<id>/             manifest.json (written last), reference.tif or flow.tif, notes.txt
    results/<id>/              result.nc, shift-<view>.nc, history.jsonl, report.html, manifest.json (written last)
    print/                     PDFs of the pattern and of boards, and what was printed (pattern.json, board.json)
    checkpoint/                a reconstruction that was stopped: `airlens reconstruct` goes on from it
    truth.npz                  simulated experiments only: the room that the twin looks at

A folder without a manifest is an interrupted one: listed as such, never used as a result.
"""

import errno
import hashlib
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

from app.errors import BadInputError
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.files.durable import publish_folder, staging_folder, write_json, write_text
from app.files.reading import inside, parse_json, reading
from app.files.toml import Strict, from_toml, to_toml
from core.scene import Scene

SETTINGS_FILE = "experiment.toml"
TRUTH_FILE = "truth.npz"
WHAT_TO_DO = "Remove the folder, or restore it from a copy."
_MOMENT = "%Y%m%dT%H%M%S"


class ExperimentSettings(Strict):
    """The content of experiment.toml."""

    schema_version: Literal[1] = 1
    """Of this file."""
    title: str = ""
    """A name for people."""
    information: str = ""
    """Notes; or what was told of the room."""
    rig: RigSettings = RigSettings()
    """The devices."""
    scene: Scene
    """Room, air, cameras, light, and what is known."""


def bundle_path(experiment: Path) -> Path:
    """Where an experiment's folder keeps the calibration's models."""
    return experiment / "calibration" / "bundle.json"


@dataclass(frozen=True)
class Experiment:
    """An experiment folder and its settings. `revision` tells one content of experiment.toml from another."""

    folder: Path
    settings: ExperimentSettings
    revision: str = ""

    @property
    def bundle_path(self) -> Path:
        """The calibration's models."""
        return bundle_path(self.folder)

    @property
    def captures_folder(self) -> Path:
        """One folder a capture."""
        return self.folder / "captures"

    @property
    def results_folder(self) -> Path:
        """One folder a result."""
        return self.folder / "results"

    @property
    def checkpoint_folder(self) -> Path:
        """What `airlens reconstruct` goes on from; gone when it has ended."""
        return self.folder / "checkpoint"

    @property
    def truth(self) -> Path | None:
        """The volume that a simulated rig looks at; None for a real rig."""
        camera = self.settings.rig.camera
        if not isinstance(camera, SimulatedCameraSettings):
            return None
        path = self.folder / camera.room
        return path if path.is_file() else None

    def file(self, name: str) -> Path:
        """A file that the settings name, inside the folder. Raises BadInputError for a path outside it."""
        path = inside(self.folder, name)
        if not path.is_file():
            raise BadInputError(
                f"The experiment names {name!r}, but {path} does not exist. Put the file there."
            )
        return path

    def latest_capture(self, role: str) -> Path:
        """The newest finished capture of a role. Raises BadInputError when there is none."""
        for folder in reversed(finished(self.captures_folder)):
            if read_manifest(folder).get("role") == role:
                return folder
        raise BadInputError(
            f"{self.folder} has no finished {role} capture. Take one: airlens capture {role} {self._quoted}"
        )

    def latest_result(self) -> Path:
        """The newest finished result. Raises BadInputError when there is none."""
        found = finished(self.results_folder)
        if not found:
            raise BadInputError(
                f"{self.folder} has no finished result. Make one: airlens reconstruct {self._quoted}"
            )
        return found[-1]

    @property
    def _quoted(self) -> str:
        """The folder as a shell takes it."""
        return shlex.quote(str(self.folder))

    def result(self, given: Path | None = None) -> Path:
        """That result, or without one the newest. Raises BadInputError for a folder that is no result."""
        if given is None:
            return self.latest_result()
        if not (given / "manifest.json").is_file():
            there = ", ".join(str(folder) for folder in finished(self.results_folder)) or "none yet"
            raise BadInputError(f"{given} is no result. Results of {self.folder}: {there}.")
        return given


def open_experiment(folder: Path) -> Experiment:
    """Read an experiment folder. Raises BadInputError."""
    path = folder / SETTINGS_FILE
    if folder.is_file():
        raise BadInputError(f"{folder} is a file. Give the folder that it is in: {folder.parent}")
    if not path.exists():
        raise BadInputError(f"There is no {path}. Give the folder of an experiment; `airlens new` makes one.")
    with reading(path, "Correct the file."):
        return parse_experiment(folder, path.read_bytes())


def parse_experiment(folder: Path, content: bytes) -> Experiment:
    """The experiment whose experiment.toml has this content. Raises BadInputError."""
    path = folder / SETTINGS_FILE
    with reading(path, "Write it in UTF-8."):
        text = content.decode("utf-8")
    return Experiment(folder, from_toml(text, ExperimentSettings, str(path)), revision_of(content))


def revision_of(content: bytes) -> str:
    """A short hash: equal for equal content only."""
    return hashlib.sha256(content).hexdigest()[:16]


def create_experiment(folder: Path, settings: ExperimentSettings) -> Experiment:
    """Make a new experiment folder. Raises BadInputError when there already is one."""
    if (folder / SETTINGS_FILE).exists():
        raise BadInputError(
            f"{folder} already holds an experiment; give another folder, or remove this one first."
        )
    return save_settings(folder, settings)


def save_settings(folder: Path, settings: ExperimentSettings) -> Experiment:
    """Write experiment.toml durably. Who read it before holds `locked(folder)` from then on."""
    text = to_toml(settings)
    if from_toml(text, ExperimentSettings, "experiment.toml") != settings:
        raise BadInputError("A text holds characters that TOML cannot keep. Write it without them.")
    write_text(folder / SETTINGS_FILE, text)
    return Experiment(folder, settings, revision_of(text.encode()))


def new_id(parent: Path, stem: str) -> str:
    """A fresh folder name: time, then what it is. It sorts after every name that is there.

    Two within a second, and one after the clock was set back, are named by the second after the newest.
    """
    moment = datetime.fromtimestamp(int(time.time()), UTC)
    there = [found for path in parent.glob("*-*") if (found := _moment_of(path.name)) is not None]
    if there:
        moment = max(moment, max(there) + timedelta(seconds=1))
    return f"{moment.strftime(_MOMENT)}-{stem}"


def _moment_of(name: str) -> datetime | None:
    try:
        return datetime.strptime(name.partition("-")[0], _MOMENT).replace(tzinfo=UTC)
    except ValueError:
        return None


def new_folder(parent: Path, stem: str, fill: Callable[[Path], object]) -> Path:
    """A folder with a fresh id, which appears as a whole once `fill(folder)` is through.

    Two that are made at once get two ids.
    """
    with staging_folder(parent / stem) as unfinished:
        fill(unfinished)
        while True:
            target = parent / new_id(parent, stem)
            try:
                publish_folder(unfinished, target)
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
            else:
                return target


def finished(parent: Path) -> list[Path]:
    """Folders below `parent` that hold a manifest, oldest first."""
    return sorted(path.parent for path in parent.glob("[!.]*/manifest.json"))


def interrupted(parent: Path) -> list[Path]:
    """Folders below `parent` without a manifest: never results."""
    return sorted(p for p in parent.glob("*/") if not (p / "manifest.json").exists())


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a finished capture or result. Raises BadInputError when it is not JSON."""
    path = folder / "manifest.json"
    with reading(path, WHAT_TO_DO):
        text = path.read_bytes()
    return parse_manifest(text, path)


def parse_manifest(text: bytes, path: Path) -> dict[str, Any]:
    """The manifest in the bytes of `path`. Raises BadInputError when they are not a JSON object."""
    return parse_json(text, path, WHAT_TO_DO)


def write_manifest(folder: Path, content: dict[str, Any]) -> None:
    """Mark a folder as finished: written last, durably."""
    write_json(folder / "manifest.json", content)
