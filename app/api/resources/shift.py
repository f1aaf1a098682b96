"""How far the picture moved since the reference, for the eyes: drift of the border, and what the air does."""

from datetime import UTC, datetime

import numpy as np
from fastapi import APIRouter

from app.api.models.shift import ShiftResource
from app.api.services import Given, Services
from app.api.wire.problems import ApiError
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, read_manifest
from app.rig.live_camera import CameraState
from drivers.protocols import Frame
from drivers.quick_look import quick_look

router = APIRouter(tags=["devices"])


@router.get("/devices/camera/shift")
def read_shift(given: Given) -> ShiftResource:
    """Compare one frame of the connected camera with the newest reference of its experiment."""
    frame, experiment = _frame(given), given.folders.open(given.camera.status.experiment or "")
    folder = experiment.latest_capture("reference")
    reference = load_capture(folder).images[0].mean
    seen = frame.pixels.astype(np.float32) / np.float32(frame.full_scale_counts)
    if seen.shape != reference.shape:
        raise ApiError("conflict", "The image has another size than the reference.", "Take a new one.")
    found = quick_look(reference, seen)
    return ShiftResource(
        reference=folder.name,
        age_s=_age_s(experiment, folder.name),
        drift_px=[float(part) for part in found.drift_px],
        drift_spread_px=found.drift_spread_px,
        largest_px=found.largest_px,
        tiles=len(found.inner_px),
    )


def _frame(given: Services) -> Frame:
    """The frame that is shown, or a fresh one where nobody looks."""
    if given.camera.status.state is CameraState.capturing and given.camera.newest is not None:
        return given.camera.newest
    with given.camera.using(CameraState.ready) as camera:
        return camera.grab()


def _age_s(experiment: Experiment, capture: str) -> float:
    created = read_manifest(experiment.captures_folder / capture).get("created", "")
    return max(0.0, (datetime.now(UTC) - datetime.fromisoformat(created)).total_seconds())
