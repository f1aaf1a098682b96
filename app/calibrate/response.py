"""Response and drift from pictures on disk.

Layout of a response folder, any number of frames in each subfolder (at least two, better eight):

    dark/               lens covered, same exposure
    grey_0 ... grey_255 the projector showing that level (or grey_0.5: a part of white)
    exposure_0.01 ...   steady light at that exposure time [s]: the camera's linearity
"""

import dataclasses
import re
from pathlib import Path

import numpy as np
import tifffile

from app.calibrate.folder import CalibrationFolder, StepName, now
from app.calibrate.whose import check_own
from app.errors import BadInputError
from app.files.durable import write_durably
from app.files.image_folder import find_images, read_grey
from calibration.bundle import Bundle
from calibration.drift import Drift, measure_drift
from calibration.errors import CalibrationError
from calibration.registration import border_mask
from calibration.response import flat_field, measure_camera, measure_projector


def calibrate_response(calibration: CalibrationFolder, camera: str, folder: Path, bits: int) -> Bundle:
    """Measure dark level, gain, read noise, linearity, the projector's curve and the flat field.

    Raises BadInputError for a folder that does not hold what is needed, and for another view's camera.
    """
    check_own(calibration, camera, StepName.response)
    bursts = _bursts(folder)
    if "dark" not in bursts:
        raise BadInputError(f"{folder} has no subfolder 'dark'; take frames with the lens covered.")
    grey = _numbered(bursts, "grey")
    timed = _numbered(bursts, "exposure")
    ramp = timed or grey
    if not ramp:
        raise BadInputError(
            f"{folder} has neither grey_<level> nor exposure_<seconds> subfolders; take one burst a level."
        )
    try:
        times = tuple(ramp) if timed else None
        response = measure_camera(camera, bursts["dark"], tuple(ramp.values()), bits, times)
        projector = None
        if len(grey) >= 4:
            top = max(grey)
            levels = tuple(level / top for level in grey)
            projector = measure_projector(levels, tuple(grey.values()), response.dark_counts, bits)
            flat = flat_field(grey[top], grey[min(grey)], bits)
            path = calibration.flat_field(camera)
            write_durably(path, lambda temporary: tifffile.imwrite(temporary, flat))
            response = dataclasses.replace(response, flat_field=path.name)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error

    def change(old: Bundle) -> Bundle:
        new = old.with_response(response)
        if projector is not None:
            new = new.with_view(camera, calibration.is_first(camera), projector_response=projector)
        return dataclasses.replace(new, date=now())

    return calibration.change_bundle(change)


def drift_between(
    reference: Path, flow: Path, border_px: int, marks: tuple[tuple[int, int, int, int], ...]
) -> Drift:
    """Drift of two pictures by their border and, in boxes (x0, y0, x1, y1), printed marks."""
    first, second = read_grey(reference), read_grey(flow)
    mask = np.zeros(first.shape, bool)
    for x0, y0, x1, y1 in marks:
        mask[y0:y1, x0:x1] = True
    try:
        border = border_mask((first.shape[0], first.shape[1]), border_px)
        return measure_drift(first, second, border, mask if marks else None)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error


def _bursts(folder: Path) -> dict[str, np.ndarray]:
    """Frames by the subfolder's name."""
    found: dict[str, list[Path]] = {}
    for file in find_images(folder, "*/*"):
        found.setdefault(file.parent.name, []).append(file)
    bursts = {}
    for name, files in found.items():
        frames = [read_grey(file) for file in files]
        if len({frame.shape for frame in frames}) != 1:
            raise BadInputError(f"{folder / name} holds frames of different sizes; retake that burst.")
        bursts[name] = np.stack(frames)
    return bursts


def _numbered(bursts: dict[str, np.ndarray], stem: str) -> dict[float, np.ndarray]:
    """Bursts of `stem`_<number> by their number, rising."""
    found = {}
    for name, burst in bursts.items():
        match = re.fullmatch(rf"{stem}_([0-9.eE+-]+)", name)
        if match:
            found[float(match[1])] = burst
    return dict(sorted(found.items()))
