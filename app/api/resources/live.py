"""T of each burst while a series is taken, for the eyes."""

import numpy as np
from fastapi import APIRouter, Response

from app.api.models.live import LivePlaneResource, LiveResource
from app.api.services import Given
from app.api.wire.bodies import body
from app.api.wire.volumes import pack
from app.live.beside import LivePlane

router = APIRouter(tags=["captures"])
NUMBERS = {
    **body("application/octet-stream", "Little-endian numbers in C order: T [K] over x and z."),
    204: {"description": "There is none yet."},
}


@router.get("/captures/live")
def read_live(given: Given) -> LiveResource:
    """Return what is looked at, and what is told of the newest picture of T."""
    now = given.beside.status
    return LiveResource(
        state=now.state.value,
        experiment=now.experiment,
        capture=now.capture,
        reason=now.reason,
        skipped=now.skipped,
        plane=None if now.plane is None else _plane(now.plane),
    )


@router.get("/captures/live/plane", response_class=Response, responses=NUMBERS)
def read_live_plane(given: Given) -> Response:
    """Return the newest picture of T; 204 while there is none."""
    plane = given.beside.status.plane
    if plane is None:
        return Response(status_code=204)
    packed = pack(plane.kelvin, "f32")
    return Response(packed.content, media_type="application/octet-stream", headers=packed.headers)


def _plane(plane: LivePlane) -> LivePlaneResource:
    return LivePlaneResource(
        capture=plane.capture,
        created=plane.created,
        x_m=list(plane.x_m),
        z_m=list(plane.z_m),
        noise_k=plane.noise_k,
        took_s=plane.took_s,
        scale_k=list(plane.scale_k),
        lowest_k=float(np.nanmin(plane.kelvin)),
        highest_k=float(np.nanmax(plane.kelvin)),
    )
