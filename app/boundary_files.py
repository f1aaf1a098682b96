"""Files that a scene's boundary names: plane fields (NPZ) and point sensors (CSV), read strictly."""

import csv
import zipfile
from pathlib import Path

import numpy as np

from app.errors import BadInputError
from app.experiment import Experiment
from core.problem import PlaneData, SensorData
from core.scene import PlaneField, PointSensors, Scene

_PLANE_AXES = {"x": "yz", "y": "xz", "z": "xy"}
_SENSOR_COLUMNS = ("x", "y", "z", "T", "T_std", "u", "v", "w", "u_std")


def read_planes(experiment: Experiment, scene: Scene) -> tuple[PlaneData, ...]:
    """Every plane field of the scene. Raises BadInputError."""
    return tuple(
        read_plane(experiment.file(known.file), known.wall)
        for known in scene.boundary
        if isinstance(known, PlaneField)
    )


def read_sensors(experiment: Experiment, scene: Scene) -> tuple[SensorData, ...]:
    """Every table of point sensors of the scene. Raises BadInputError."""
    return tuple(
        read_sensor_table(experiment.file(known.file), scene)
        for known in scene.boundary
        if isinstance(known, PointSensors)
    )


def read_plane(path: Path, wall: str) -> PlaneData:
    """A plane field: the wall's two axes, T, p and u on them. Raises BadInputError."""
    first, second = _PLANE_AXES[wall[0]]
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], np.float64) for name in (first, second, "T", "p", "u")}
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise BadInputError(f"{path} is not a readable plane field ({error}); write it again.") from None
    except KeyError as error:
        raise BadInputError(
            f"{path} has no array {error}; a plane on {wall} needs {first}, {second}, T, p and u."
        ) from None
    shape = (len(arrays[first]), len(arrays[second]))
    for name, expected in (("T", shape), ("p", shape), ("u", (*shape, 3))):
        if arrays[name].shape != expected or not np.isfinite(arrays[name]).all():
            raise BadInputError(
                f"{path}: {name} has shape {arrays[name].shape}; expected finite values of shape {expected}."
            )
    if arrays["T"].min() <= 0:
        raise BadInputError(f"{path}: T reaches {arrays['T'].min():g}; expected kelvin, above 0.")
    return PlaneData(wall, arrays[first], arrays[second], arrays["T"], arrays["p"], arrays["u"])


def read_sensor_table(path: Path, scene: Scene) -> SensorData:
    """Point sensors: a CSV with a header of x, y, z and any of T, T_std, u, v, w, u_std (SI).

    Raises BadInputError for an unknown column, a value that is not a number, or a place outside the room.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadInputError(f"{path} is not a readable CSV ({error}).") from None
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
    if np.nanmin(table["T"], initial=1e3) < 150:
        raise BadInputError(f"{path}: T reaches {np.nanmin(table['T']):g}; give kelvin (20 C is 293.15).")
    return SensorData(
        position_m=position,
        temperature_k=table["T"],
        temperature_std_k=np.where(np.isnan(table["T_std"]), 0.2, table["T_std"]),
        velocity_m_s=np.stack([table[axis] for axis in "uvw"], axis=-1),
        velocity_std_m_s=np.where(np.isnan(table["u_std"]), 0.05, table["u_std"]),
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
