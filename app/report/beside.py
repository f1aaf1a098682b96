"""What was found at a few places that tell a room, with intervals, beside the truth where there is one."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from app.volume.file import RoomVolume
from app.volume.score import truth_at
from core.comfort import CELSIUS_K
from core.geometry import Vector3, face_of
from core.occupied import ANKLE_M, HEAD_M
from core.result import Solution
from core.scene import Inlet, Scene
from core.significance import EITHER_WAY

# How far before a supply its jet is looked at, at most, and as a share of the room.
_BEFORE_M, _BEFORE_SHARE = 1.0, 0.3


@dataclass(frozen=True)
class Place:
    """A place with its words: temperature [C] and speed [m/s], half of each 95 % interval, and the truth.

    None is what is not known there, or where an object stands.
    """

    words: str
    at_m: Vector3
    celsius: float | None
    celsius_half: float | None
    celsius_true: float | None
    speed_m_s: float | None
    speed_half_m_s: float | None
    speed_true_m_s: float | None


def places(solution: Solution, scene: Scene, truth: RoomVolume | None = None) -> tuple[Place, ...]:
    """The first supply's jet, the middle of the room, and a sitting person's head and ankles further on."""
    true_k, true_m_s = _true(solution, truth)
    speed, along = _speed(solution)
    std_k = solution.temperature_std_k
    told = []
    for words, at_m in _where(scene):
        celsius, half_k, true, fast, half_m_s, true_fast = (
            None if field is None else _at(solution, field, at_m)
            for field in (solution.temperature_k, std_k, true_k, speed, along, true_m_s)
        )
        told.append(
            Place(
                words,
                at_m,
                _celsius(celsius),
                None if half_k is None else EITHER_WAY * half_k,
                _celsius(true),
                fast,
                None if half_m_s is None else EITHER_WAY * half_m_s,
                true_fast,
            )
        )
    return tuple(told)


def rows(found: tuple[Place, ...]) -> list[tuple[str, ...]]:
    """The table as text: place, temperature, its truth, speed, its truth."""
    return [
        (
            f"{place.words} ({', '.join(f'{x:.2f}' for x in place.at_m)} m)",
            _told(place.celsius, place.celsius_half, "°C", 2),
            _told(place.celsius_true, None, "°C", 2),
            _told(place.speed_m_s, place.speed_half_m_s, "m/s", 2),
            _told(place.speed_true_m_s, None, "m/s", 2),
        )
        for place in found
    ]


def _true(solution: Solution, truth: RoomVolume | None) -> tuple[np.ndarray | None, np.ndarray | None]:
    """The truth's temperature and speed on the solution's vertices."""
    if truth is None:
        return None, None
    speed = np.linalg.norm(truth.velocity_m_s, axis=-1)
    return truth_at(truth, solution, truth.temperature_k), truth_at(truth, solution, speed)


def _speed(solution: Solution) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Speed, and its deviation: that of the velocity along itself."""
    velocity, std = solution.velocity_m_s, solution.velocity_std_m_s
    if velocity is None:
        return None, None
    speed = np.linalg.norm(velocity, axis=-1)
    if std is None:
        return speed, None
    unit = velocity / np.maximum(speed, 1e-9)[..., None]
    return speed, np.linalg.norm(unit * std, axis=-1)


def _celsius(kelvin: float | None) -> float | None:
    return None if kelvin is None else kelvin - CELSIUS_K


def _where(scene: Scene) -> list[tuple[str, Vector3]]:
    (x0, y0, z0), (x1, y1, z1) = scene.room.lower_m, scene.room.upper_m
    middle = scene.room.centre_m
    chosen: list[tuple[str, Vector3]] = []
    supply = next((part for part in scene.boundary if isinstance(part, Inlet)), None)
    if supply is not None:
        face = face_of(supply.patch.wall)
        at = [0.0, 0.0, 0.0]
        for axis, low, high in zip(face.along, supply.patch.lower_m, supply.patch.upper_m, strict=True):
            at[axis] = 0.5 * (low + high)
        reach = min(_BEFORE_M, _BEFORE_SHARE * scene.room.size_m[face.axis])
        wall = (scene.room.lower_m, scene.room.upper_m)[0 if face.inward > 0 else 1][face.axis]
        at[face.axis] = wall + face.inward * reach
        chosen.append((f"{reach:.2g} m before the supply", (at[0], at[1], at[2])))
    x, y = x0 + 0.7 * (x1 - x0), 0.5 * (y0 + y1)
    chosen.append(("middle of the room", middle))
    for words, height_m in (("head of a sitting person", HEAD_M), ("ankles", ANKLE_M)):
        if z0 + height_m < z1:
            chosen.append((words, (x, y, z0 + height_m)))
    return chosen


def _at(solution: Solution, field: np.ndarray, at_m: Vector3) -> float | None:
    """The field there, linear between vertices; None in and on an object, which holds no air."""
    axes = (solution.x_m, solution.y_m, solution.z_m)
    inside = [np.clip(x, axis[0], axis[-1]) for x, axis in zip(at_m, axes, strict=True)]
    value = float(RegularGridInterpolator(axes, np.asarray(field, np.float64))(inside)[0])
    return None if np.isnan(value) else value


def _told(value: float | None, half: float | None, unit: str, digits: int) -> str:
    if value is None:
        return "-"
    sure = "" if half is None else f" ± {half:.{digits}f}"
    return f"{value:.{digits}f}{sure} {unit}"
