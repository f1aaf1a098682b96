"""Captures: take, watch, abort, keep or discard, look at, annotate."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Literal

import cv2
import numpy as np
from fastapi import APIRouter, Query, Response

from app.api.folders import child
from app.api.models.captures import (
    Abort,
    CaptureChange,
    CaptureResource,
    DeskResource,
    NewCapture,
    NewImport,
    Retake,
)
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.captured import NOTES, capture_line, capture_resource
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.api.wire.revision import IfMatch, check_revision, etag
from app.api.wire.volumes import Encoding, pack
from app.capture.burst import Order
from app.capture.imported import TakenBy, import_files
from app.capture.service import DeskState
from app.errors import BadInputError
from app.experiment.capture_files import BurstImage
from app.experiment.captures import load_capture
from app.experiment.views import view_names
from app.files.durable import write_text
from app.rig.conditions import Conditions, conditions_in
from drivers.burst import CapturePlan

router = APIRouter(tags=["captures"])
ViewNumber = Annotated[int, Query(ge=0, lt=100, description="Which view's picture, from 0.")]
PICTURE = body("image/png", "A picture for the eyes: stretched from the 1st to the 99th percentile.")
NUMBERS = body("application/octet-stream", "Rows of little-endian numbers; value = X-Offset + X-Scale * n.")


@router.get("/captures/running")
async def read_desk(given: Given) -> DeskResource:
    """Return the capture that is being taken, or the last one."""
    return DeskResource.of(given.desk.status)


@router.post("/captures/running/abort")
def abort_capture(given: Given, wanted: Abort) -> DeskResource:
    """End the running capture within a frame."""
    return DeskResource.of(given.desk.abort(wanted.discard))


@router.post("/experiments/{experiment}/captures", status_code=202)
def start_capture(given: Given, experiment: Identifier, new: NewCapture) -> DeskResource:
    """Begin a capture; it goes on when the browser is closed."""
    found = given.confirmed.check(given.folders.open(experiment))
    return DeskResource.of(given.desk.start(found, order_of(new)))


@router.post("/experiments/{experiment}/captures/{capture}/retake", status_code=202)
def retake_capture(given: Given, experiment: Identifier, capture: Identifier, wanted: Retake) -> DeskResource:
    """Begin to take one camera's picture of a capture again, alone; the other cameras' stay.

    A capture that lacks the view is completed; of one that is whole a new one is made.
    """
    found = given.confirmed.check(given.folders.open(experiment))
    folder = _capture(given, experiment, capture)
    told = conditions_in(wanted.model_dump())
    return DeskResource.of(given.desk.retake(found, folder.name, wanted.view, told))


def order_of(new: NewCapture) -> Order:
    """The same for the camera. Raises DeviceSettingError for several bursts without `every_s`."""
    content = new.model_dump()
    plan = {field.name: content[field.name] for field in fields(CapturePlan)}
    return Order(CapturePlan(**plan), new.bursts, new.every_s, conditions_in(content), new.at_once, new.live)


@router.post("/experiments/{experiment}/captures/imported", status_code=201)
def import_captures(given: Given, experiment: Identifier, new: NewImport) -> list[CaptureResource]:
    """Make captures of uploaded pictures that another camera took; the uploads are removed."""
    found = given.folders.open(experiment)
    files: dict[TakenBy, list[Path]] = {}
    called: dict[Path, str] = {}
    for one in new.pictures:
        for upload in one.uploads:
            pictures = _pictures(given, upload)
            files.setdefault(TakenBy(one.role, one.view), []).extend(pictures)
            called |= pictures
    lossy = [
        TakenBy(one.role, one.view) for one in new.pictures if "jpeg" in map(given.uploads.kind, one.uploads)
    ]
    told = Conditions(new.ambient_temperature_k)
    taken = import_files(found, files, new.bits, told, lossy=lossy, called=called)
    for one in new.pictures:
        for upload in one.uploads:
            given.uploads.delete(upload)
    given.ledger.append_event("experiment", {"experiment": experiment, "changed": True})
    names = view_names(found)
    return [capture_line(burst.folder, names) for burst in taken if burst.folder is not None]


def _pictures(given: Services, upload: str) -> Mapping[Path, str]:
    found = given.uploads.pictures(upload)
    if not found:
        raise ApiError(
            "not_found", f"There is no upload {upload!r} that holds pictures.", "Send the file again."
        )
    return found


@router.get("/experiments/{experiment}/captures")
def list_captures(given: Given, experiment: Identifier) -> list[CaptureResource]:
    """List the captures, newest first; interrupted ones last, the one that is being taken not yet."""
    done, broken = given.folders.items(experiment, "capture")
    desk = given.desk.status
    if desk.state is DeskState.running and desk.experiment == experiment:
        broken = [folder for folder in broken if folder.name != desk.capture]
    names = _names(given, experiment)
    return [capture_line(folder, names) for folder in (*done, *broken)]


@router.get("/experiments/{experiment}/captures/{capture}")
def read_capture(
    given: Given, experiment: Identifier, capture: Identifier, response: Response
) -> CaptureResource:
    """Return one capture."""
    found = capture_resource(given.folders.item(experiment, "capture", capture), _names(given, experiment))
    response.headers.update(etag(found.revision))
    return found


@router.patch("/experiments/{experiment}/captures/{capture}")
def change_capture(
    given: Given,
    experiment: Identifier,
    capture: Identifier,
    change: CaptureChange,
    response: Response,
    if_match: IfMatch = None,
) -> CaptureResource:
    """Write notes beside a capture."""
    with given.folders.locked(experiment):
        folder = given.folders.item(experiment, "capture", capture)
        names = _names(given, experiment)
        before = capture_resource(folder, names)
        current = {"revision": before.revision, "notes": before.notes}
        check_revision(if_match, current, change.model_dump())
        write_text(folder / NOTES, change.notes)
        found = capture_resource(folder, names)
    response.headers.update(etag(found.revision))
    return found


@router.delete("/experiments/{experiment}/captures/{capture}", status_code=204)
def discard_capture(given: Given, experiment: Identifier, capture: Identifier) -> None:
    """Remove a capture, finished or interrupted, with everything in it."""
    found = _capture(given, experiment, capture)
    if given.desk.status.state.value == "running" and given.desk.status.capture == capture:
        raise ApiError("conflict", "This capture is being taken.", "Abort it first.")
    given.folders.remove(found)


@router.get(
    "/experiments/{experiment}/captures/{capture}/picture", response_class=Response, responses=PICTURE
)
def read_picture(
    given: Given,
    experiment: Identifier,
    capture: Identifier,
    width: Annotated[int, Query(ge=16, le=4096, description="At most so many columns.")] = 320,
    what: Annotated[Literal["mean", "std"], Query()] = "mean",
    view: ViewNumber = 0,
) -> Response:
    """Return a small picture of the mean or of the noise."""
    image = _image(given, experiment, capture, view)
    return Response(_png(image.mean if what == "mean" else image.std, width), media_type="image/png")


@router.get("/experiments/{experiment}/captures/{capture}/image", response_class=Response, responses=NUMBERS)
def read_image(
    given: Given,
    experiment: Identifier,
    capture: Identifier,
    encoding: Encoding = "f32",
    view: ViewNumber = 0,
) -> Response:
    """Return the mean image as numbers, as fractions of full scale."""
    packed = pack(_image(given, experiment, capture, view).mean, encoding)
    return Response(packed.content, media_type="application/octet-stream", headers=packed.headers)


def _capture(given: Services, experiment: str, capture: str) -> Path:
    """The folder of a capture, finished or interrupted."""
    found = child(given.folders.folder(experiment) / "captures", capture)
    if found is None:
        raise ApiError("not_found", f"Experiment {experiment!r} has no capture {capture!r}.")
    return found


def _image(given: Services, experiment: str, capture: str, view: int) -> BurstImage:
    images = load_capture(given.folders.item(experiment, "capture", capture)).images
    if view >= len(images):
        raise ApiError(
            "not_found", f"The capture {capture!r} has {len(images)} views; there is no view {view}."
        )
    return images[view]


def _names(given: Services, experiment: str) -> tuple[str, ...]:
    """What the views are called; nothing where experiment.toml cannot be read: captures are listed all the same."""
    try:
        return view_names(given.folders.open(experiment))
    except BadInputError:
        return ()


def _png(image: np.ndarray, width: int) -> bytes:
    step = max(1, -(-image.shape[1] // width))
    rows, cols = (size // step for size in image.shape)
    small = cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA)
    low, high = np.percentile(small, (1.0, 99.0))
    shown = np.clip((small - low) * (255.0 / max(high - low, 1e-9)), 0, 255).astype(np.uint8)
    done, encoded = cv2.imencode(".png", shown)
    return encoded.tobytes() if done else b""
