"""The rig's devices: their states, their settings as read back, and the live picture."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import StreamingResponse

from app.api.models.devices import Asked, CameraChange, CameraResource, OpenCamera
from app.api.resources.projector import ProjectorResource, projector_resource
from app.api.services import Given, services_of
from app.api.wire.bodies import body
from app.api.wire.problems import ApiError
from app.api.wire.viewer import Viewer
from app.experiment.views import opened_for
from app.rig.frame_statistics import LiveFrame
from app.rig.live_camera import CameraState
from app.rig.open import open_camera

router = APIRouter(tags=["devices"])
MJPEG = "multipart/x-mixed-replace; boundary=frame"
JPEG_BODY = body("image/jpeg", "What the camera sees now.")
MJPEG_BODY = body("multipart/x-mixed-replace", "JPEG after JPEG, without end.")
FRAME_LIMIT_S = 3.0
ViewNumber = Annotated[int, Query(ge=0, lt=100, description="Which view's camera, from 0.")]
Stretch = Annotated[Literal["0", "1"], Query(description="1 stretches the contrast, for the eyes only.")]


@router.get("/devices")
async def list_devices(given: Given) -> list[CameraResource | ProjectorResource]:
    """List the devices and their states: the cameras by their view's number, then the projectors likewise."""
    cameras = [CameraResource.of(one.status) for one in given.cameras.known]
    return [*cameras, *(projector_resource(one.report) for one in given.projectors.known)]


@router.get("/devices/camera")
async def read_camera(given: Given, view: ViewNumber = 0) -> CameraResource:
    """Return the state of a view's camera and its settings as read back."""
    return CameraResource.of(given.cameras.there(view).status)


@router.post("/devices/camera/connect")
def connect_camera(given: Given, wanted: OpenCamera) -> CameraResource:
    """Connect, or reconnect, the camera of a view of a rig; the answer's `view` is the one whose camera it is."""
    experiment, view = given.confirmed.check(given.folders.open(wanted.experiment)), wanted.view
    views = len(experiment.settings.scene.views)
    if view >= views:
        raise ApiError("not_found", f"The experiment has {views} views; there is no view {view}.")
    view = opened_for(experiment, view)
    status = given.cameras.open(
        wanted.experiment, view, lambda: open_camera(experiment, wanted.air, view), wanted.air
    )
    return CameraResource.of(status)


@router.post("/devices/camera/disconnect")
def disconnect_camera(given: Given) -> CameraResource:
    """Let the cameras of all views go, for another program."""
    given.cameras.close()
    return CameraResource.of(given.camera.status)


@router.patch("/devices/camera")
def change_camera(given: Given, change: CameraChange) -> CameraResource:
    """Set exposure and gain of a view's camera; the answer holds what it granted."""
    return CameraResource.of(given.cameras.there(change.view).set(change.exposure_s, change.gain))


@router.get("/devices/camera/frame", response_class=Response, responses=JPEG_BODY)
async def read_frame(given: Given, stretch: Stretch = "0", view: ViewNumber = 0) -> Response:
    """Return one JPEG of what a view's camera sees now, with its numbers in `X-Statistics`."""
    camera = given.cameras.there(view)
    if camera.status.state not in (CameraState.ready, CameraState.capturing):
        raise ApiError("conflict", "No camera is connected.", "Connect the camera first.")
    async with Viewer(camera, stretch == "1") as viewer:
        try:
            frame = await asyncio.wait_for(viewer.next_frame(), FRAME_LIMIT_S)
        except TimeoutError:
            frame = None
    if frame is None:
        raise ApiError("unavailable", "The camera showed no frame within 3 s.", "Reconnect it.")
    return Response(
        _jpeg(frame, stretch == "1"), media_type="image/jpeg", headers={"X-Statistics": _numbers(frame)}
    )


@router.get("/devices/camera/live.mjpeg", response_class=StreamingResponse, responses=MJPEG_BODY)
async def stream_mjpeg(given: Given, stretch: Stretch = "0", view: ViewNumber = 0) -> StreamingResponse:
    """Stream the live picture of a view to a browser without WebSocket."""
    camera = given.cameras.there(view)

    async def parts() -> AsyncIterator[bytes]:
        async with Viewer(camera, stretch == "1") as viewer:
            while (frame := await viewer.next_frame()) is not None:
                jpeg = _jpeg(frame, viewer.stretch)
                yield b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg)
                yield jpeg + b"\r\n"

    return StreamingResponse(parts(), media_type=MJPEG)


@router.websocket("/devices/camera/live")
async def live(socket: WebSocket, view: ViewNumber = 0) -> None:
    """Send the newest frame of a view's camera for every credit: 4 bytes of length, JSON numbers, JPEG.

    The viewer sends `{"credits": 1, "stretch": false}`; one that is slow skips frames, none is queued.
    """
    await socket.accept()
    async with Viewer(services_of(socket).cameras.of(view), credits=0) as viewer:
        listening = asyncio.create_task(_listen(socket, viewer))
        try:
            while (frame := await viewer.next_frame()) is not None:
                head = _numbers(frame).encode()
                await socket.send_bytes(len(head).to_bytes(4, "big") + head + _jpeg(frame, viewer.stretch))
        except (WebSocketDisconnect, RuntimeError):
            return
        finally:
            listening.cancel()


async def _listen(socket: WebSocket, viewer: Viewer) -> None:
    try:
        while True:
            asked = Asked.model_validate_json(await socket.receive_text())
            viewer.ask(asked.credits, asked.stretch)
    except (WebSocketDisconnect, RuntimeError, ValueError, KeyError):
        viewer.close()


def _jpeg(frame: LiveFrame, stretch: bool) -> bytes:
    return frame.jpegs.get(stretch) or next(iter(frame.jpegs.values()))


def _numbers(frame: LiveFrame) -> str:
    seen = frame.statistics
    numbers = {
        "number": frame.number,
        "timestamp_s": frame.timestamp_s,
        "rows": frame.rows,
        "cols": frame.cols,
        "mean": seen.mean,
        "saturated": seen.saturated,
        "dark": seen.dark,
        "sharpness_nd": seen.sharpness_nd,
        "histogram": seen.histogram,
    }
    return json.dumps(numbers)
