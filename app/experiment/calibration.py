"""The calibration of an experiment: the one door through which its bundle is read."""

from pathlib import Path

from app.errors import BadInputError
from calibration.bundle import Bundle, from_json
from calibration.errors import CalibrationError


def read_bundle(experiment: Path) -> Bundle | None:
    """The bundle of the experiment folder; None where nothing is calibrated. Raises BadInputError."""
    path = experiment / "calibration" / "bundle.json"
    if not path.exists():
        return None
    try:
        return from_json(path.read_text(encoding="utf-8"), str(path))
    except (CalibrationError, UnicodeDecodeError, OSError) as error:
        raise BadInputError(
            f"The calibration cannot be used: {error} Mend {path}, or move it away to work with the optics of "
            "experiment.toml."
        ) from error
