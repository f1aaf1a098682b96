"""The calibration of an experiment on disk: the record of what was seen, and the bundle made from it.

calibration/bundle.json            what the reconstruction reads
calibration/record-<camera>.json   board and wall points that the bundle was made from
calibration/started-<step>-<camera>.json   the same, of a step that is not complete: used by nothing yet
calibration/shared.json            boards that several cameras saw at once
calibration/flat-<camera>.tif      flat field, if measured
"""

import contextlib
import dataclasses
import datetime as dt
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from urllib.parse import quote

from app.experiment.calibration import read_bundle
from app.experiment.folder import SETTINGS_FILE, ExperimentSettings, bundle_path, open_experiment
from app.files.durable import make_folder, write_text
from app.files.lock import locked
from app.files.reading import reading
from app.rig.conditions import Conditions, known_pairs
from calibration.bundle import Bundle, CalibratedOptics, CalibratedWall, to_json
from calibration.errors import CalibrationError
from calibration.further_projector import FurtherProjector, build_projector
from calibration.model import Model
from calibration.record import Record, record_from_json, record_to_json
from calibration.shared import SharedRecord, shared_from_json, shared_to_json
from calibration.together import Together


class StepName(StrEnum):
    """What is calibrated, in this order."""

    camera = "camera"
    projector = "projector"
    wall = "wall"
    response = "response"


@dataclass(frozen=True)
class CalibrationFolder:
    """`experiment` may hold no experiment.toml yet: pictures can be calibrated before there is a scene."""

    experiment: Path

    @property
    def folder(self) -> Path:
        """Where the calibration's files are."""
        return self.experiment / "calibration"

    def settings(self) -> ExperimentSettings | None:
        """The experiment's settings, if there are any."""
        if not (self.experiment / SETTINGS_FILE).exists():
            return None
        return open_experiment(self.experiment).settings

    def is_first(self, camera: str) -> bool:
        """Whether that is the first view's camera, or that of a folder without a scene. Raises BadInputError."""
        settings = self.settings()
        return settings is None or settings.scene.views[0].name == camera

    def owner(self, camera: str) -> str | None:
        """The view whose camera takes the pictures of that view; None where it has its own. Raises BadInputError."""
        settings = self.settings()
        views = () if settings is None else settings.scene.views
        return next((view.camera_of for view in views if view.name == camera), None)

    def live(self, what: str, camera: str) -> Path:
        """The folder of the pictures that a guided step takes with a camera."""
        return self.folder / (f"live-{what}" if self.is_first(camera) else f"live-{what}-{in_a_name(camera)}")

    def flat_field(self, camera: str) -> Path:
        """The file of a camera's flat field."""
        return self.folder / f"flat-{in_a_name(camera)}.tif"

    def bundle(self) -> Bundle:
        """The bundle so far; an empty one if there is none. Raises BadInputError."""
        return read_bundle(self.experiment) or Bundle(date=now())

    def record(self, camera: str) -> Record | None:
        """What was seen, of the camera that the bundle holds as measured. Raises BadInputError."""
        path = self._record_path(camera)
        return _read_record(path) if path.exists() and self._is_measured(camera) else None

    def _is_measured(self, camera: str) -> bool:
        """Whether the bundle holds what the record is of: the camera, or of another view's camera the projector."""
        own = self.bundle().of(camera, self.is_first(camera))
        parts = own.cameras if self.owner(camera) is None else (own.projector,)
        return any(one is not None and one.quality.source == "measured" for one in parts)

    def collected(self, camera: str) -> Record | None:
        """What was seen so far, that of a started step included. Raises BadInputError."""
        step = self.started(camera)
        return self.record(camera) if step is None else _read_record(self._started_path(step, camera))

    def started(self, camera: str) -> StepName | None:
        """The step that was started and is not complete: there is one at a time."""
        return next((step for step in StepName if self._started_path(step, camera).exists()), None)

    def save_started(self, step: StepName, record: Record) -> None:
        """Keep what a step has seen so far, beside the calibration in use."""
        if self.record(record.camera) is None and not (record.boards or record.wall or record.level):
            self.forget_started(record.camera)
            return
        write_text(self._started_path(step, record.camera), record_to_json(record))
        for other in StepName:
            if other is not step:
                self._started_path(other, record.camera).unlink(missing_ok=True)

    def forget_started(self, camera: str) -> None:
        """Go back to the calibration in use."""
        for step in StepName:
            self._started_path(step, camera).unlink(missing_ok=True)

    def discard(self, step: StepName, camera: str) -> None:
        """Forget what a step has taken since the calibration in use was made, with its live pictures."""
        begun = self.started(camera) is step
        if begun:
            self.forget_started(camera)
        kept, live = self.record(camera), self.live(step, camera)
        unused = [live]
        if step in (StepName.camera, StepName.projector):
            names = set() if kept is None else {b.name.split("/")[0] for b in kept.boards}
            unused = [path for path in live.glob("*") if path.name not in names]
        elif step is StepName.wall and (begun or kept is None or not (kept.wall or kept.level)):
            unused = [live, self.live("level", camera)]
        elif step is StepName.wall or self.bundle().response(camera) is not None:
            unused = []
        for path in unused:
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)

    def put_to_use(self, model: Model | FurtherProjector) -> Bundle:
        """Make a complete step's models and record those in use."""
        bundle = self._save_model(model)
        write_text(self._record_path(model.record.camera), record_to_json(model.record))
        self.forget_started(model.record.camera)
        return bundle

    def _save_model(self, model: Model | FurtherProjector) -> Bundle:
        """Put the model's parts into the bundle, with the date and the pictures' hashes."""
        record = model.record
        seen = [*record.boards, *(s for s in (record.wall, record.level) if s is not None)]
        images = {s.name: s.sha256 for s in seen}

        def change(old: Bundle) -> Bundle:
            others = {name: sha for name, sha in old.images.items() if sha not in images.values()}
            new = old if isinstance(model, FurtherProjector) else old.with_camera(model.camera_optics)
            new = new.with_view(record.camera, self.is_first(record.camera), **_parts(model))
            if not isinstance(model, FurtherProjector):
                new = dataclasses.replace(self._followed(new, record.camera), joint=None)
            return dataclasses.replace(new, date=now(), images=others | images)

        return self.change_bundle(change)

    def _followed(self, bundle: Bundle, camera: str) -> Bundle:
        """The bundle with the projectors of other views that this camera sees, placed by where it is now."""
        settings = self.settings()
        for view in () if settings is None else settings.scene.views:
            record = self.record(view.name) if view.camera_of == camera else None
            if record is None:
                continue
            with contextlib.suppress(CalibrationError):  # it fitted before: what it was stays
                found = build_projector(record, bundle.camera(camera))
                bundle = bundle.with_view(view.name, self.is_first(view.name), projector=found.optics)
        return bundle

    def shared(self) -> SharedRecord:
        """The boards that several cameras saw at once, so far. Raises BadInputError."""
        if not self._shared_path.exists():
            return SharedRecord()
        with reading(self._shared_path, "Remove it and take the boards again."):
            return shared_from_json(self._shared_path.read_text(encoding="utf-8"), str(self._shared_path))

    def change_shared(self, change: Callable[[SharedRecord], SharedRecord]) -> SharedRecord:
        """Keep `change(what several cameras saw so far)`, durably; nobody else changes it in between."""
        make_folder(self.folder)
        with locked(self.folder):
            record = change(self.shared())
            write_text(self._shared_path, shared_to_json(record))
        return record

    def forget_shared(self) -> None:
        """Forget those boards, with their live pictures; the calibration in use stays."""
        self._shared_path.unlink(missing_ok=True)
        shutil.rmtree(self.live_together, ignore_errors=True)

    @property
    def live_together(self) -> Path:
        """The folder of the pictures that several cameras take at once: one folder a camera."""
        return self.folder / "live-together"

    def put_together(self, found: Together) -> Bundle:
        """Make views that were adjusted together those in use."""

        def change(old: Bundle) -> Bundle:
            for name, view in found.views.items():
                parts = {"projector": view.projector, "wall": view.wall}
                kept = {part: value for part, value in parts.items() if value is not None}
                old = old.with_camera(view.camera).with_view(name, self.is_first(name), **kept)
                old = self._followed(old, name)
            return dataclasses.replace(old, date=now(), joint=found.joint)

        return self.change_bundle(change)

    def note(self, conditions: Conditions) -> None:
        """Write the conditions into the bundle, if there is one; what is not known leaves what was."""
        known = known_pairs(conditions)
        if known and bundle_path(self.experiment).exists():
            self.change_bundle(lambda bundle: dataclasses.replace(bundle, **known))

    def change_bundle(self, change: Callable[[Bundle], Bundle]) -> Bundle:
        """Replace the bundle by `change(bundle)`, durably; nobody else writes it in between."""
        make_folder(self.folder)
        with locked(self.folder):
            bundle = change(self.bundle())
            write_text(bundle_path(self.experiment), to_json(bundle))
        return bundle

    @property
    def _shared_path(self) -> Path:
        return self.folder / "shared.json"

    def _record_path(self, camera: str) -> Path:
        return self.folder / f"record-{in_a_name(camera)}.json"

    def _started_path(self, step: StepName, camera: str) -> Path:
        return self.folder / f"started-{step}-{in_a_name(camera)}.json"


def in_a_name(camera: str) -> str:
    """A camera's name as part of a file's."""
    return quote(camera, safe=" ()+,@")


def _parts(model: Model | FurtherProjector) -> dict[str, CalibratedOptics | CalibratedWall]:
    """What a view has of its own by a model."""
    if isinstance(model, FurtherProjector):
        return {"projector": model.optics}
    parts = {"projector": model.projector_optics, "wall": model.wall}
    return {name: part for name, part in parts.items() if part is not None}


def _read_record(path: Path) -> Record:
    with reading(path, "Remove it and calibrate again."):
        return record_from_json(path.read_text(encoding="utf-8"), str(path))


def now() -> str:
    """The present moment, ISO 8601 with time zone."""
    return dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
