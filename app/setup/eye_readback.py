"""Cameras and projectors of a scene as answers, whoever wrote it."""

import math
from typing import Any

import numpy as np

from app.experiment.folder import ExperimentSettings
from app.experiment.rig_settings import CameraSettings, SimulatedCameraSettings
from app.setup.answers import FIRST
from app.setup.written import SceneReading
from core.geometry import Optics
from core.scene import CheckerPattern, Light, ProjectedPattern, View
from core.view_frame import turn_to


def camera_answer(settings: ExperimentSettings, view: View, told: SceneReading) -> dict[str, Any]:
    """The first camera, which looks at y_max."""
    device = settings.rig.camera
    answer = _eye(view, device, told)
    if device is None:
        told.unsaid.append("No camera is named: pictures are imported.")
    elif isinstance(device, SimulatedCameraSettings):
        answer["truth"] = device.room
    return answer


def view_answers(settings: ExperimentSettings, told: SceneReading) -> list[dict[str, Any]]:
    """The further cameras, of a scene whose first one is answered as `camera`."""
    rig, scene = settings.rig, settings.scene
    lit, answers = {"y_max"}, []
    for view in (one for one in scene.views[1:] if one.camera_of is None):
        simulated = isinstance(rig.camera, SimulatedCameraSettings)
        device = rig.camera if simulated else (rig.cameras or {}).get(view.name)
        answer = {"name": view.name, "wall": view.wall} | _eye(view, device, told)
        light = view.light or scene.light
        if view.wall not in lit:
            answer |= _pattern(light)
            if isinstance(light, ProjectedPattern):
                answer["projector"] = projector_answer(light.projector, _address(settings, view), told)
        elif view.wall == "y_max" and view.light is not None:
            told.unsaid.append(f"{view.name} sees {view.wall} by a light of its own.")
        lit.add(view.wall)
        answers.append(answer)
    return answers


def light_answers(settings: ExperimentSettings, told: SceneReading) -> list[dict[str, Any]]:
    """The further projectors, of a scene whose first camera is answered as `camera`."""
    first = settings.scene.views[0].name
    return [
        {"name": view.name, "camera_of": FIRST if view.camera_of == first else view.camera_of}
        | _pattern(view.light)
        | projector_answer(view.light.projector, _address(settings, view), told)
        for view in settings.scene.views
        if view.camera_of is not None and isinstance(view.light, ProjectedPattern)
    ]


def projector_answer(optics: Optics, url: str, told: SceneReading) -> dict[str, Any]:
    """A projector."""
    return {
        "position": told.place(optics.position_m),
        "width_px": optics.width_px,
        "height_px": optics.height_px,
        "angle_of_view": f"{_angle_deg(optics):.9g} deg",
        "url": url,
    }


def _pattern(light: Light) -> dict[str, Any]:
    return {} if isinstance(light.pattern, CheckerPattern) else {"pattern_seed": light.pattern.seed}


def _address(settings: ExperimentSettings, view: View) -> str:
    """Where a view's own projector is spoken to."""
    spoken = (settings.rig.projectors or {}).get(view.name)
    return spoken.url if spoken else ""


def _eye(view: View, device: CameraSettings | None, told: SceneReading) -> dict[str, Any]:
    optics = view.camera
    if any(optics.rotation_rad) and not _is_straight(turn_to(view.wall).optics(optics)):
        name = "The camera" if view.name == "camera" else view.name
        told.unsaid.append(f"{name} is turned: its direction stays as it is when its place changes.")
    answer: dict[str, Any] = {
        "kind": "v4l2" if device is None else device.kind,
        "width_px": optics.width_px,
        "height_px": optics.height_px,
        "bits": view.noise.bits,
        "frames": view.frames,
        "angle_of_view": f"{_angle_deg(optics):.9g} deg",
        "position": told.place(optics.position_m),
    }
    if device is not None and not isinstance(device, SimulatedCameraSettings):
        answer |= {"device": device.device, "pixel_format": device.pixel_format}
    if device is not None and device.exposure_s is not None:
        answer["exposure"] = f"{1000 * device.exposure_s:.9g} ms"
    return answer


def _is_straight(optics: Optics) -> bool:
    """Whether it looks along y, upright."""
    return bool(np.allclose(optics.rotation @ np.array([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0], atol=1e-6))


def _angle_deg(optics: Optics) -> float:
    return math.degrees(2 * math.atan(optics.width_px / (2 * optics.focal_px[0])))
