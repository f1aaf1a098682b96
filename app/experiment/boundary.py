"""Files that a scene's boundary names: plane fields (NPZ) and point sensors (CSV), read strictly."""

import csv
from pathlib import Path

import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.files.npz import read_npz
from app.files.reading import reading
from core.geometry import Box, face_of
from core.problem import PlaneData, SensorData
from core.scene import PlaneField, PointSensors, Scene

_SENSOR_COLUMNS = ("x", "y", "z", "T", "T_std", "u", "v", "w", "u_std")


def read_planes(experiment: Experiment, scene: Scene) -> tuple[PlaneData, ...]:
    """Every plane field of the scene. Raises BadInputError."""
    planes = []
    for known in scene.boundary:
        if isinstance(known, PlaneField):
            path = experiment.file(known.file)
            planes.append(read_plane(path, known.wall))
            _check_in_room(path, planes[-1], scene.room)
    return tuple(planes)


def read_sensors(experiment: Experiment, scene: Scene) -> tuple[SensorData, ...]:
    """Every table of point sensors of the scene. Raises BadInputError."""
    return tuple(
        read_sensor_table(experiment.file(known.file), scene)
        for known in scene.boundary
        if isinstance(known, PointSensors)
    )


def read_plane(path: Path, wall: str) -> PlaneData:
    """A plane field: the wall's two axes, T, p and u on them. Raises BadInputError."""
    first, second = ("xyz"[axis] for axis in face_of(wall).along)
    names = (first, second, "T", "p", "u")
    what_to_do = f"A plane field on {wall} holds {first}, {second}, T, p and u; write it again."
    with reading(path, what_to_do):
        arrays = {n: np.asarray(a, np.float64) for n, a in read_npz(path, what_to_do, names).items()}
    shape = (len(arrays[first]), len(arrays[second]))
    for name, expected in (("T", shape), ("p", shape), ("u", (*shape, 3))):
        if arrays[name].shape != expected or not np.isfinite(arrays[name]).all():
            raise BadInputError(
                f"{path}: {name} has shape {arrays[name].shape}; expected finite values of shape {expected}."
            )
    for name in (first, second):
        axis = arrays[name]
        if axis.ndim != 1 or len(axis) < 2 or not np.isfinite(axis).all() or np.any(np.diff(axis) <= 0):
            raise BadInputError(
                f"{path}: the coordinates {name} do not increase; expected at least two increasing values in metres."
            )
    _check_kelvin(path, arrays["T"])
    return PlaneData(wall, arrays[first], arrays[second], arrays["T"], arrays["p"], arrays["u"])


def read_sensor_table(path: Path, scene: Scene) -> SensorData:
    """Point sensors: a CSV with a header of x, y, z and any of T, T_std, u, v, w, u_std (SI).

    Raises BadInputError for an unknown column, a value that is not a number, or a place outside the room.
    """
    with reading(path, "Give a CSV file in UTF-8."), path.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file))
    unknown = [name for name in (rows[0] if rows else {}) if name not in _SENSOR_COLUMNS]
    if not rows or unknown:
        raise BadInputError(
            f"{path} has {'no rows' if not rows else 'unknown columns ' + ', '.join(map(repr, unknown))}; "
            f"expected a header of x, y, z and any of {', '.join(_SENSOR_COLUMNS[3:])}."
        )
    table = {name: np.array([_number(row.get(name), path, name) for row in rows]) for name in _SENSOR_COLUMNS}
    position = np.stack([table[axis] for axis in "xyz"], axis=-1)
    room = scene.room
    outside = ~np.all((position >= room.lower_m) & (position <= room.upper_m), axis=1)
    if outside.any():
        raise BadInputError(
            f"{path}: the sensor in row {int(outside.argmax()) + 2} at {position[outside][0]} m is outside the "
            f"room {room.lower_m} to {room.upper_m} m. Were millimetres given for metres?"
        )
    _check_kelvin(path, table["T"])
    for name in ("T_std", "u_std"):
        if not np.nanmin(table[name], initial=1.0) > 0:
            raise BadInputError(
                f"{path}: {name} reaches {np.nanmin(table[name]):g}; give the standard deviation of each reading, "
                "above 0, or leave the column out."
            )
    return SensorData(
        position_m=position,
        temperature_k=table["T"],
        temperature_std_k=np.where(np.isnan(table["T_std"]), 0.2, table["T_std"]),
        velocity_m_s=np.stack([table[axis] for axis in "uvw"], axis=-1),
        velocity_std_m_s=np.where(np.isnan(table["u_std"]), 0.05, table["u_std"]),
    )


def _check_kelvin(path: Path, temperature_k: np.ndarray) -> None:
    """NaN is no reading; every other one is a temperature of air."""
    low, high = np.nanmin(temperature_k, initial=300.0), np.nanmax(temperature_k, initial=300.0)
    if low < 150 or high > 5000:
        wrong = low if low < 150 else high
        raise BadInputError(
            f"{path}: T reaches {wrong:g}; give kelvin, 150 to 5000 (20 degrees Celsius is 293.15)."
        )


def _check_in_room(path: Path, plane: PlaneData, room: Box) -> None:
    """A plane reaches a tenth of the room beyond its wall at most: more is another unit or another room."""
    for axis, line in zip(face_of(plane.wall).along, (plane.first_m, plane.second_m), strict=True):
        slack_m = 0.1 * room.size_m[axis]
        if line[0] < room.lower_m[axis] - slack_m or line[-1] > room.upper_m[axis] + slack_m:
            raise BadInputError(
                f"{path}: the plane spans {line[0]:g} to {line[-1]:g} m along {'xyz'[axis]}; the room spans "
                f"{room.lower_m[axis]:g} to {room.upper_m[axis]:g} m. Were millimetres given for metres?"
            )


def _number(text: str | None, path: Path, name: str) -> float:
    if text is None or not text.strip():
        if name in ("x", "y", "z"):
            raise BadInputError(f"{path}: a row has no {name}; every sensor needs x, y and z in metres.")
        return float("nan")
    try:
        return float(text)
    except ValueError:
        raise BadInputError(f"{path}: {name} is {text!r}; expected a number.") from None
