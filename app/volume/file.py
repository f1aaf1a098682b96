"""Room volumes: the NPZ format of an airflow ground truth (T, p, u on a vertex grid), read strictly.

Arrays are indexed [ix, iy, iz] at vertices x, y, z [m], end planes included. T in K, kinematic p in m2/s2,
u in m/s with the last axis x, y, z. `solid` marks vertices in or on obstacles, where values mean nothing (NaN, too).
`meta_json` may describe the case: domain, inlets, outlet or outlets, heater, walls. An opening stands on xMinWall
unless its `wall` names another (xMaxWall, front, back, floor, ceiling); it spans two axes of that wall, such as
`"x": [1.0, 1.4], "y": [0.0, 0.3]`, and its `U` [m/s] enters at right angles.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from app.errors import BadInputError
from app.files.npz import read_npz
from app.files.reading import reading

Axes = tuple[np.ndarray, np.ndarray, np.ndarray]

_REQUIRED = ("x", "y", "z", "T", "p", "u", "T0")


@dataclass(frozen=True)
class RoomVolume:
    """Temperature, pressure and velocity of a room, and what is known of how it was made."""

    x_m: Float[np.ndarray, " nx"]
    y_m: Float[np.ndarray, " ny"]
    z_m: Float[np.ndarray, " nz"]
    temperature_k: Float[np.ndarray, "nx ny nz"]
    pressure_m2_s2: Float[np.ndarray, "nx ny nz"]
    velocity_m_s: Float[np.ndarray, "nx ny nz 3"]
    ambient_k: float
    density_kg_m3: float = 1.2041
    gladstone_dale_m3_kg: float = 2.26e-4
    case: dict[str, Any] = field(default_factory=dict)
    solid: Bool[np.ndarray, "nx ny nz"] | None = None
    scalars: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Beside:
    """One quantity on the result's vertices: what is true, and found minus true."""

    name: str
    unit: str
    label: str
    truth: Float[np.ndarray, "nx ny nz"]
    error: Float[np.ndarray, "nx ny nz"]


def read_volume(path: Path) -> RoomVolume:
    """Read and check a volume. Raises BadInputError for anything that is not one."""
    if not path.is_file():
        raise BadInputError(f"There is no volume {path}. Give an NPZ file with T, p and u of a room.")
    what_to_do = "It may be truncated; export the volume again."
    with reading(path, what_to_do):
        return _volume(path, read_npz(path, what_to_do))


def _volume(path: Path, arrays: dict[str, np.ndarray]) -> RoomVolume:
    missing = [name for name in _REQUIRED if name not in arrays]
    if missing:
        raise BadInputError(
            f"{path} has no {', '.join(missing)}; expected the arrays {', '.join(_REQUIRED)}. "
            "Is it another kind of NPZ?"
        )
    x, y, z = (np.asarray(arrays[name], np.float64) for name in "xyz")
    shape = tuple(len(axis) if axis.ndim == 1 else -1 for axis in (x, y, z))
    case = _case(arrays)
    solid = _solid(arrays, case, (x, y, z))
    if solid is not None and (solid.shape != shape or solid.all()):
        raise BadInputError(
            f"{path}: solid has shape {solid.shape} and marks {int(solid.sum())} vertices; expected {shape}, "
            "and some vertices of air. Export the volume again."
        )
    for name, expected in (("T", shape), ("p", shape), ("u", (*shape, 3))):
        if arrays[name].shape != expected:
            raise BadInputError(f"{path}: {name} has shape {arrays[name].shape}; expected {expected}.")
        air = np.asarray(arrays[name])[~solid] if solid is not None and solid.shape == shape else arrays[name]
        if not np.isfinite(air).all():
            raise BadInputError(f"{path}: {name} holds values that are not finite; export the volume again.")
    for name, axis in zip("xyz", (x, y, z), strict=True):
        if len(axis) < 2 or not np.isfinite(axis).all() or np.any(np.diff(axis) <= 0):
            raise BadInputError(
                f"{path}: the coordinates {name} do not increase, so the box has no volume; "
                "expected at least two increasing values in metres."
            )
    if solid is not None:
        arrays = arrays | {name: filled(np.asarray(arrays[name]), solid) for name in ("T", "p", "u")}
    _check_temperature(path, "T", arrays["T"])
    _check_temperature(path, "T0", arrays["T0"])
    scalars = {k: v.item() for k, v in arrays.items() if v.ndim == 0 and v.dtype.kind in "fiu"}
    return RoomVolume(
        x_m=x,
        y_m=y,
        z_m=z,
        temperature_k=np.asarray(arrays["T"], np.float32),
        pressure_m2_s2=np.asarray(arrays["p"], np.float32),
        velocity_m_s=np.asarray(arrays["u"], np.float32),
        ambient_k=float(arrays["T0"]),
        density_kg_m3=float(arrays.get("rho0", 1.2041)),
        gladstone_dale_m3_kg=float(arrays.get("G", 2.26e-4)),
        case=case,
        solid=solid,
        scalars=scalars,
    )


def filled(
    field: Float[np.ndarray, "nx ny nz ..."], solid: Bool[np.ndarray, "nx ny nz"]
) -> Float[np.ndarray, "nx ny nz ..."]:
    """The field with the nearest air's values in solid vertices."""
    places = ndimage.distance_transform_edt(solid, return_distances=False, return_indices=True)
    return field[tuple(cast("np.ndarray", places))]


def _solid(arrays: dict[str, np.ndarray], case: dict[str, Any], axes_m: Axes) -> np.ndarray | None:
    """Vertices in or on obstacles: as the volume marks them, else by the obstacles' boxes; None without any."""
    if "solid" in arrays:
        return np.asarray(arrays["solid"], bool)
    inside = np.zeros([len(axis) for axis in axes_m], bool)
    for item in case.get("obstacles", []):
        spans = [
            (axis >= low - 1e-5) & (axis <= high + 1e-5)
            for axis, low, high in zip(axes_m, item["lower"], item["upper"], strict=True)
        ]
        inside |= spans[0][:, None, None] & spans[1][None, :, None] & spans[2][None, None, :]
    return inside if inside.any() else None


def _check_temperature(path: Path, name: str, temperature_k: np.ndarray) -> None:
    lowest, highest = float(temperature_k.min()), float(temperature_k.max())
    if not (lowest >= 150 and highest <= 5000):
        hint = " Were degrees Celsius given for kelvin?" if -80 < lowest < 150 else ""
        raise BadInputError(
            f"{path}: {name} runs from {lowest:g} to {highest:g}; expected kelvin, 150 to 5000.{hint}"
        )


def _case(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    if "meta_json" not in arrays:
        return {}
    return dict(json.loads(str(arrays["meta_json"])).get("case", {}))
