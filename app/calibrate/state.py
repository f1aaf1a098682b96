"""How far a guided calibration is, in plain values: what the page draws and `airlens calibrate` prints."""

from dataclasses import dataclass

import numpy as np

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.steps import own_model
from calibration.advice import CELLS, advise, coverage
from calibration.errors import CalibrationError
from calibration.further_projector import FurtherProjector
from calibration.intrinsics import Intrinsics
from calibration.model import Model
from calibration.record import Record, SeenBoard, array_of

MOST_RESIDUALS = 2000


@dataclass(frozen=True)
class ViewState:
    """One view of a board; `rms_px` is known from three views on."""

    name: str
    points: int
    rms_px: float | None
    issues: tuple[str, ...]


@dataclass(frozen=True)
class CalibrationState:
    """What one device's calibration came to so far.

    `coverage` are rows from the top, cells from the left; `residuals_px` are column, row and the residual
    there; `size_px` is the picture that both refer to.
    """

    complete: bool
    size_px: tuple[int, int] | None
    views: tuple[ViewState, ...]
    coverage: tuple[tuple[bool, ...], ...]
    covered: float
    rms_px: float | None
    residuals_px: tuple[tuple[float, float, float, float], ...]
    advice: tuple[str, ...]


def state_of(calibration: CalibrationFolder, record: Record | None, step: StepName) -> CalibrationState:
    """The state of the camera, or of the projector when that is the step."""
    of_projector = step is StepName.projector
    boards = () if record is None else tuple(b for b in record.boards if b.panel_px or not of_projector)
    size = None if record is None else record.panel_size_px if of_projector else record.camera_size_px
    try:
        model = None if record is None else own_model(calibration, record)
    except CalibrationError:
        model = None
    fit = _fit(model, of_projector)
    pixels = tuple(array_of(b.panel_px if of_projector else b.camera_px, 2) for b in boards)
    seen = coverage(pixels, size) if pixels and size else np.zeros(CELLS, bool)
    rms = [None] * len(boards) if fit is None else list(fit.view_rms_px)
    names = tuple(_short(b) for b in boards)
    return CalibrationState(
        complete=fit is not None,
        size_px=size,
        views=tuple(
            ViewState(n, len(p), r, b.issues) for n, p, r, b in zip(names, pixels, rms, boards, strict=True)
        ),
        coverage=tuple(tuple(map(bool, row)) for row in seen),
        covered=float(seen.mean()),
        rms_px=None if fit is None else fit.rms_px,
        residuals_px=() if fit is None else _residuals(fit),
        advice=() if fit is None or size is None else advise(fit, names, size),
    )


def line_of(calibration: CalibrationFolder, record: Record | None, step: StepName) -> str:
    """One line for the terminal after a view."""
    state = state_of(calibration, record, step)
    fit = "" if state.rms_px is None else f", rms {state.rms_px:.3f} px"
    many = "1 view" if len(state.views) == 1 else f"{len(state.views)} views"
    return f"{many}, {100 * state.covered:.0f} % of the picture covered{fit}"


def _fit(model: Model | FurtherProjector | None, of_projector: bool) -> Intrinsics | None:
    if model is None:
        return None
    if isinstance(model, FurtherProjector):
        return model.projector if of_projector else None
    if not of_projector:
        return model.camera
    return None if model.pair is None else model.pair.projector


def _residuals(fit: Intrinsics) -> tuple[tuple[float, float, float, float], ...]:
    pixels = np.concatenate([s.pixels_px for s in fit.sightings])
    left = np.concatenate(fit.adjusted.residuals_px)
    some = np.unique(np.linspace(0, len(pixels) - 1, min(len(pixels), MOST_RESIDUALS)).astype(int))
    return tuple(
        (float(x), float(y), float(u), float(v))
        for (x, y), (u, v) in zip(pixels[some], left[some], strict=True)
    )


def _short(board: SeenBoard) -> str:
    """The name by which a view is retaken: its file, or its folder."""
    return board.name.split("/")[0]
