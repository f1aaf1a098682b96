"""Cameras and what patterns their walls, from answers: each is made in its wall's own frame, and turned back."""

import math
from collections.abc import Sequence
from dataclasses import replace

from app.errors import BadInputError
from app.experiment.folder import TRUTH_FILE
from app.experiment.rig_settings import (
    AravisCameraSettings,
    CameraSettings,
    ProjectorSettings,
    SimulatedCameraSettings,
    V4l2CameraSettings,
)
from app.setup.answers import Answers, CameraAnswer, EyeAnswer, ProjectorAnswer, ViewAnswer
from app.volume.scene import projected
from core.geometry import Box, Optics, Vector3, WallName, looking_along_y
from core.plan.print_choice import suited_print
from core.scene import CameraNoise, Light, View
from core.view_frame import Turn, turn_to


def moved(place_m: Vector3, corner_m: Vector3) -> Vector3:
    """A place that was measured from the room's corner, in the world."""
    x, y, z = (value + corner for value, corner in zip(place_m, corner_m, strict=True))
    return x, y, z


def eye_of(camera: EyeAnswer, wall: WallName, room: Box) -> Optics:
    """The camera, straight at its wall; before the wall's middle where only the distance is told."""
    turn = turn_to(wall)
    framed = turn.box(room)
    if camera.position is None:
        middle_m = framed.centre_m
        place_m = (middle_m[0], framed.upper_m[1] - (camera.distance or 0.0), middle_m[2])
    else:
        place_m = turn.point(moved(camera.position, room.lower_m))
    return _back(turn, _straight(place_m, camera.width_px, camera.height_px, _focal_px(camera)))


def light_of(thrown: ProjectorAnswer | None, seed: int, camera: Optics, wall: WallName, room: Box) -> Light:
    """What patterns the camera's wall: a print that suits the camera, or what the projector throws."""
    turn = turn_to(wall)
    eye = camera if turn.is_none else turn.optics(camera)
    if thrown is None:
        return suited_print(eye, turn.box(room).upper_m[1] - eye.position_m[1], seed)
    focal_px = _focal_of_angle(thrown.width_px, thrown.angle_of_view)
    place_m = turn.point(moved(thrown.position, room.lower_m))
    light = projected(eye, _straight(place_m, thrown.width_px, thrown.height_px, focal_px), seed)
    return replace(light, projector=_back(turn, light.projector))


def view_of(camera: CameraAnswer, optics: Optics) -> View:
    """The first view, which sees by the scene's light."""
    return View(camera=optics, noise=CameraNoise(bits=camera.bits), frames=camera.frames)


def further_views(answers: Answers, room: Box) -> list[View]:
    """The other views in their order; the cameras of one wall have one light, and those of y_max the scene's."""
    lights: dict[WallName, Light | None] = {"y_max": None}
    views = []
    for item in answers.view:
        optics = eye_of(item, item.wall, room)
        if item.wall not in lights:
            lights[item.wall] = light_of(item.projector, item.pattern_seed, optics, item.wall, room)
        views.append(
            View(
                name=item.name,
                camera=optics,
                wall=item.wall,
                light=lights[item.wall],
                noise=CameraNoise(bits=item.bits),
                frames=item.frames,
            )
        )
    return views


def further_lights(answers: Answers, room: Box, cameras: Sequence[View]) -> list[View]:
    """A view for each further projector: that of its camera, under this light. Raises BadInputError."""
    owners = {view.name: view for view in cameras}
    views = []
    for item in answers.light:
        owner = owners.get(item.camera_of)
        if owner is None:
            raise BadInputError(
                f"light: {item.name!r} is seen by {item.camera_of!r}, which is no camera here."
            )
        light = light_of(item, item.pattern_seed, owner.camera, owner.wall, room)
        views.append(replace(owner, name=item.name, camera_of=owner.name, light=light))
    return views


def device_of(camera: EyeAnswer) -> CameraSettings:
    """The device that a camera is read from."""
    if camera.kind == "simulated":
        told = {"room": TRUTH_FILE} | ({} if camera.exposure is None else {"exposure_s": camera.exposure})
        return SimulatedCameraSettings.model_validate(told)
    told = {
        "kind": camera.kind,
        "device": camera.device,
        "pixel_format": camera.pixel_format,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "bits": camera.bits,
        "exposure_s": camera.exposure,
    }
    return (AravisCameraSettings if camera.kind == "aravis" else V4l2CameraSettings).model_validate(told)


def devices_of(views: Sequence[ViewAnswer]) -> dict[str, CameraSettings]:
    """The devices of further views by their names; those of a simulated rig are its first camera's twins."""
    return {item.name: device_of(item) for item in views if item.kind != "simulated"}


def addresses_of(answers: Answers) -> dict[str, ProjectorSettings]:
    """The projectors that are spoken to beside the first one, by the names of their views."""
    thrown = {item.name: item.projector for item in answers.view} | {
        item.name: item for item in answers.light
    }
    return {name: ProjectorSettings(url=one.url) for name, one in thrown.items() if one and one.url}


def _back(turn: Turn, optics: Optics) -> Optics:
    """Optics of a wall's frame in the room; those of y_max are there, to the last digit."""
    return optics if turn.is_none else turn.back().optics(optics)


def _straight(place_m: Vector3, width_px: int, height_px: int, focal_px: float) -> Optics:
    return looking_along_y(position_m=place_m, width_px=width_px, height_px=height_px, focal_px=focal_px)


def _focal_px(camera: EyeAnswer) -> float:
    if camera.angle_of_view is not None:
        return _focal_of_angle(camera.width_px, camera.angle_of_view)
    return (camera.focal_length or 0.0) / (camera.pixel_pitch or 1.0)


def _focal_of_angle(width_px: int, angle_deg: float) -> float:
    return 0.5 * width_px / math.tan(math.radians(angle_deg) / 2)
