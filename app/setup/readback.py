"""A scene as answers, whoever wrote it, so that the page can edit it; and in words what no answer can say.

What is told in `unsaid` stays in the scene as it is when answers change (`app/setup/change.py`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.errors import BadInputError
from app.experiment.boundary import read_sensor_table
from app.experiment.folder import Experiment, ExperimentSettings
from app.setup.answers import LONGEST, MANY
from app.setup.eye_readback import camera_answer, light_answers, projector_answer, view_answers
from app.setup.written import SceneReading, celsius, metres
from core.geometry import Vector3, face_of
from core.objects import RoomObject
from core.problem import SensorData
from core.scene import (
    CheckerPattern,
    Heater,
    Inlet,
    Outlet,
    Patch,
    PlaneField,
    PointSensors,
    ProjectedPattern,
    Scene,
    View,
    Wall,
)

_LEAST_STD = 1e-3


@dataclass(frozen=True)
class ReadBack:
    """Answers with units as a person writes them, and a sentence on each thing that they cannot say."""

    answers: dict[str, Any]
    unsaid: tuple[str, ...]


def read_back(experiment: Experiment) -> ReadBack:
    """The experiment's scene and rig as answers. Raises BadInputError where no camera looks at y_max."""
    found = scene_back(experiment.settings)
    sensors, unsaid = _sensors(experiment)
    return ReadBack(found.answers | sensors, found.unsaid + unsaid)


def scene_back(settings: ExperimentSettings) -> ReadBack:
    """The same of settings alone, without what files of sensors hold."""
    told = SceneReading(settings.scene.room.lower_m)
    view = asked_view(settings.scene)
    answers: dict[str, Any] = {
        "title": settings.title[:LONGEST],
        "room": [metres(value) for value in settings.scene.room.size_m],
        "air": celsius(settings.scene.air.ambient_temperature_k),
        "camera": camera_answer(settings, view, told),
    }
    if not isinstance(settings.scene.light.pattern, CheckerPattern):
        answers["pattern_seed"] = settings.scene.light.pattern.seed
    if isinstance(settings.scene.light, ProjectedPattern):
        spoken = settings.rig.projector
        url = spoken.url if spoken else ""
        answers["projector"] = projector_answer(settings.scene.light.projector, url, told)
    answers |= _boundary(settings.scene, told)
    answers["object"] = [_object(item, told) for item in settings.scene.objects]
    if view is settings.scene.views[0]:
        answers["view"] = view_answers(settings, told)
        answers["light"] = light_answers(settings, told)
    else:
        others = [one.name for one in settings.scene.views if one is not view]
        told.unsaid.append(f"Further cameras: {', '.join(others)}.")
    return ReadBack({name: value for name, value in answers.items() if value != []}, tuple(told.unsaid))


def asked_view(scene: Scene) -> View:
    """The view that the answers' camera is: the first that looks at y_max. Raises BadInputError."""
    found = next((view for view in scene.views if view.wall == "y_max"), None)
    if found is None:
        raise BadInputError(
            "No camera looks at the wall y_max, which the page draws the room from: change rig and room in "
            "experiment.toml."
        )
    return found


def listed_tables(experiment: Experiment) -> frozenset[str]:
    """The tables of sensors that answers can hold: short, and no anemometer with a component left out."""
    return frozenset(file for file, table in _tables(experiment).items() if _is_short(table))


def answer_of(box: RoomObject, corner_m: Vector3) -> dict[str, Any]:
    """An object as an answer, its place measured from the room's corner."""
    return _object(box, SceneReading(corner_m))


def _kelvin(value_k: float) -> str:
    return f"{max(value_k, _LEAST_STD):.9g} K"


def _boundary(scene: Scene, told: SceneReading) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {"supply": [], "outlet": [], "surface": [], "wall": []}
    for part in scene.boundary:
        match part:
            case Inlet() if part.inward_m_s > 0:
                found["supply"].append(_supply(part, len(found["supply"]) + 1, told))
            case Inlet():
                told.unsaid.append(f"A supply on {part.patch.wall} does not blow into the room.")
            case Outlet():
                flow = {} if part.flow_m3_s is None else {"flow": f"{3600 * part.flow_m3_s:.9g} m3/h"}
                reading = _reading(part, part.mean_temperature_k)
                found["outlet"].append(_opening(part.patch, told) | flow | reading)
            case Heater():
                found["surface"].append(_opening(part.patch, told) | _reading(part, part.temperature_k))
            case Wall():
                found["wall"] += _wall(part, told)
            case PlaneField():
                told.unsaid.append(f"{part.file}: temperature and velocity known on the plane {part.wall}.")
            case PointSensors():
                pass
    return found


def _supply(inlet: Inlet, number: int, told: SceneReading) -> dict[str, Any]:
    speed_m_s = inlet.inward_m_s
    if abs(speed_m_s - math.hypot(*inlet.velocity_m_s)) > 1e-6 * speed_m_s:
        told.unsaid.append(
            f"Supply {number} blows at an angle to its wall. Its speed here is the part straight off the wall; the "
            "part along the wall stays as it is."
        )
    share = min(1.0, max(1e-4, inlet.velocity_std_m_s / speed_m_s))
    return {
        **_opening(inlet.patch, told),
        "speed": f"{speed_m_s:.9g} m/s",
        "deviation": f"{100 * share:.9g} %",
        **_reading(inlet, inlet.temperature_k),
    }


def _opening(patch: Patch, told: SceneReading) -> dict[str, Any]:
    corner = [told.corner_m[axis] for axis in face_of(patch.wall).along]
    return {
        "wall": patch.wall,
        "lower": [metres(value - start) for value, start in zip(patch.lower_m, corner, strict=True)],
        "upper": [metres(value - start) for value, start in zip(patch.upper_m, corner, strict=True)],
    }


def _reading(part: Inlet | Outlet | Heater | Wall | RoomObject, value_k: float | None) -> dict[str, Any]:
    if value_k is None:
        return {}
    return {"temperature": celsius(value_k), "temperature_deviation": _kelvin(part.temperature_std_k)}


def _wall(wall: Wall, told: SceneReading) -> list[dict[str, Any]]:
    if not wall.no_slip:
        told.unsaid.append(f"Air does not stick to the wall {wall.wall}.")
    if wall.thermal == "unknown":
        return []
    known = {"adiabatic": True} if wall.thermal == "adiabatic" else _reading(wall, wall.temperature_k)
    return [{"wall": wall.wall} | known]


def _object(item: RoomObject, told: SceneReading) -> dict[str, Any]:
    middle_m = tuple(0.5 * (low + high) for low, high in zip(item.lower_m, item.upper_m, strict=True))
    answer: dict[str, Any] = {
        "kind": "box",
        "position": told.place((middle_m[0], middle_m[1], item.lower_m[2])),
        "size": [metres(value) for value in item.size_m],
    }
    if item.thermal == "power" and item.power_w is not None:
        answer |= {"heat": f"{item.power_w:.9g} W", "heat_deviation": f"{max(item.power_std_w, 0.1):.9g} W"}
    return answer | _reading(item, item.temperature_k)


def _tables(experiment: Experiment) -> dict[str, SensorData]:
    scene = experiment.settings.scene
    files = (part.file for part in scene.boundary if isinstance(part, PointSensors))
    return {file: read_sensor_table(experiment.file(file), scene) for file in files}


def _is_short(table: SensorData) -> bool:
    known = np.isfinite(table.velocity_m_s)
    return len(table.position_m) <= MANY and bool(np.all(known.all(axis=1) == known.any(axis=1)))


def _sensors(experiment: Experiment) -> tuple[dict[str, Any], tuple[str, ...]]:
    told = SceneReading(experiment.settings.scene.room.lower_m)
    found: dict[str, list[dict[str, Any]]] = {"thermometer": [], "anemometer": []}
    for file, table in _tables(experiment).items():
        if not _is_short(table):
            told.unsaid.append(
                f"{file}: {len(table.position_m)} readings; up to {MANY}, with all parts of a velocity or none, "
                "can be listed here."
            )
            continue
        for at_m, value_k, std_k, velocity, std_m_s in zip(
            table.position_m,
            table.temperature_k,
            table.temperature_std_k,
            table.velocity_m_s,
            table.velocity_std_m_s,
            strict=True,
        ):
            place = {"position": told.place((float(at_m[0]), float(at_m[1]), float(at_m[2])))}
            if np.isfinite(value_k):
                reading = {
                    "temperature": celsius(float(value_k)),
                    "temperature_deviation": _kelvin(float(std_k)),
                }
                found["thermometer"].append(place | reading)
            if np.isfinite(velocity).all():
                parts = [f"{float(part):.9g} m/s" for part in velocity]
                found["anemometer"].append(
                    place | {"velocity": parts, "deviation": f"{float(std_m_s):.9g} m/s"}
                )
    return {name: items for name, items in found.items() if items}, tuple(told.unsaid)
