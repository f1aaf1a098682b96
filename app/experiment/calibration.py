"""The calibration of an experiment: the one door through which its bundle is read."""

import functools
from pathlib import Path

from app.errors import BadInputError
from app.experiment.folder import bundle_path
from app.files.reading import reading
from calibration.bundle import Bundle, from_json


def read_bundle(experiment: Path) -> Bundle | None:
    """The bundle of the experiment folder; None where nothing is calibrated. Raises BadInputError.

    It is parsed again only when its content is another.
    """
    path = bundle_path(experiment)
    try:
        with reading(path, "Calibrate again, or restore it from a copy."):
            return _parsed(path.read_bytes(), path) if path.exists() else None
    except BadInputError as error:
        raise BadInputError(
            f"The calibration cannot be used: {error} Mend {path}, or move it away to work with the optics of "
            "experiment.toml."
        ) from error


@functools.lru_cache(maxsize=64)
def _parsed(content: bytes, path: Path) -> Bundle:
    return from_json(content.decode("utf-8"), str(path))
