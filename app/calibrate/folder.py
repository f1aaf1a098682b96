"""The calibration of an experiment on disk: the record of what was seen, and the bundle made from it.

calibration/bundle.json            what the reconstruction reads
calibration/record-<camera>.json   board and wall points, so that each step adds to the ones before
calibration/flat-<camera>.tif      flat field, if measured
"""

import dataclasses
import datetime as dt
from dataclasses import dataclass
from pathlib import Path

from app.errors import BadInputError
from app.experiment.calibration import read_bundle
from app.experiment.folder import ExperimentSettings, open_experiment
from app.files.durable import write_text
from calibration.bundle import Bundle, to_json
from calibration.errors import CalibrationError
from calibration.model import Model
from calibration.record import Record, record_from_json, record_to_json


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
        if not (self.experiment / "experiment.toml").exists():
            return None
        return open_experiment(self.experiment).settings

    def bundle(self) -> Bundle:
        """The bundle so far; an empty one if there is none. Raises BadInputError."""
        return read_bundle(self.experiment) or Bundle(date=now())

    def record(self, camera: str) -> Record | None:
        """What was seen so far. Raises BadInputError."""
        path = self._record_path(camera)
        if not path.exists():
            return None
        try:
            return record_from_json(path.read_text(encoding="utf-8"), str(path))
        except (CalibrationError, UnicodeDecodeError) as error:
            raise BadInputError(str(error)) from error

    def save_record(self, record: Record) -> None:
        """Keep what was seen, also when it is not yet enough for a model."""
        write_text(self._record_path(record.camera), record_to_json(record))

    def save_model(self, model: Model) -> Bundle:
        """Put the model's parts into the bundle, with the date and the pictures' hashes."""
        old = self.bundle()
        record = model.record
        seen = [*record.boards, *(s for s in (record.wall, record.level) if s is not None)]
        images = {s.name: s.sha256 for s in seen}
        others = {name: sha for name, sha in old.images.items() if sha not in images.values()}
        bundle = dataclasses.replace(
            old.with_camera(model.camera_optics),
            date=now(),
            projector=model.projector_optics or old.projector,
            wall=model.wall or old.wall,
            images=others | images,
        )
        self.save_bundle(bundle)
        return bundle

    def save_bundle(self, bundle: Bundle) -> None:
        """Write bundle.json durably."""
        write_text(self.folder / "bundle.json", to_json(bundle))

    def _record_path(self, camera: str) -> Path:
        return self.folder / f"record-{camera}.json"


def now() -> str:
    """The present moment, ISO 8601 with time zone."""
    return dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
