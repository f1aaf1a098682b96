"""How far the picture moved since the reference, for the eyes: drift of the border, and what the air does."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from fastapi import APIRouter
from jaxtyping import Float32

from app.api.models.shift import ShiftResource
from app.api.resources.devices import ViewNumber
from app.api.services import Given, Services
from app.api.wire.problems import ApiError
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, read_manifest
from app.experiment.views import opened_for
from app.rig.live_camera import CameraState, LiveCamera
from drivers.protocols import Frame
from drivers.quick_look import quick_look
from drivers.settings import grab_settled

router = APIRouter(tags=["devices"])


@router.get("/devices/camera/shift")
def read_shift(given: Given, view: ViewNumber = 0) -> ShiftResource:
    """Compare one frame of a view's connected camera with the newest reference of its experiment."""
    camera = given.cameras.there(_opened(given, view))
    frame, experiment = _frame(camera), given.folders.open(camera.status.experiment or "")
    folder = experiment.latest_capture("reference")
    reference = _image(folder, view)
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


def _opened(given: Services, view: int) -> int:
    """Whose camera is open for a view of the experiment whose cameras are."""
    source = given.camera.status.experiment
    if source is None:
        return view
    experiment = given.folders.open(source)
    return opened_for(experiment, view) if view < len(experiment.settings.scene.views) else view


def _frame(live: LiveCamera) -> Frame:
    """The frame that is shown, or a fresh one where nobody looks."""
    if live.status.state is CameraState.capturing and live.newest is not None:
        return live.newest
    with live.using(CameraState.ready) as camera:
        return grab_settled(camera)


def _image(reference: Path, view: int) -> Float32[np.ndarray, "rows cols"]:
    images = load_capture(reference).images
    if view >= len(images):
        raise ApiError("conflict", f"The reference has no picture of view {view}.", "Take a new one.")
    return images[view].mean


def _age_s(experiment: Experiment, capture: str) -> float:
    created = read_manifest(experiment.captures_folder / capture).get("created", "")
    return max(0.0, (datetime.now(UTC) - datetime.fromisoformat(created)).total_seconds())
