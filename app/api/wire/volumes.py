"""Fields of a result as compact binary: the few that were read last are kept in memory."""

import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float32

from app.api.models.results import Kind
from app.api.wire.problems import ApiError
from app.volume.file import Beside
from core.result import Departures, Derived, Solution

Encoding = Literal["u16", "f16", "f32"]
Axis = Literal["x", "y", "z"]
KEPT = 4
_LARGEST = 65535


@dataclass(frozen=True)
class Packed:
    """Little-endian numbers; the value is `offset + scale * number`, and `missing` stands for no value."""

    content: bytes
    shape: tuple[int, ...]
    offset: float
    scale: float
    missing: int | None = None

    @property
    def headers(self) -> dict[str, str]:
        """What a reader needs beside the numbers."""
        return {
            "X-Shape": ",".join(map(str, self.shape)),
            "X-Offset": repr(self.offset),
            "X-Scale": repr(self.scale),
        } | ({} if self.missing is None else {"X-Missing": str(self.missing)})


@dataclass(frozen=True)
class Volume:
    """One scalar on the result's vertices, index order [ix, iy, iz]."""

    name: str
    unit: str
    label: str
    kind: Kind
    values: Float32[np.ndarray, "nx ny nz"]


def volumes_of(solution: Solution) -> dict[str, Volume]:
    """Return every scalar of a solution by the name that it has in result.nc; no wind in objects."""
    found = {
        "T": ("K", "temperature", solution.temperature_k),
        "p": ("m2 s-2", "kinematic pressure", solution.pressure_m2_s2),
        "T_std": ("K", "standard deviation of T", solution.temperature_std_k),
        "p_std": ("m2 s-2", "standard deviation of p", solution.pressure_std_m2_s2),
        "informed": ("1", "share of T's prior variance removed by measurement", solution.informed),
    }
    for index, axis in enumerate("xyz"):
        for stem, words, vectors in (
            ("", "velocity", solution.filled().velocity_m_s),
            ("_std", "standard deviation of velocity", solution.velocity_std_m_s),
        ):
            values = None if vectors is None else vectors[..., index]
            found["uvw"[index] + stem] = ("m s-1", f"{words} along {axis}", values)
    made = {
        name: Volume(
            name,
            unit,
            label,
            "uncertainty" if "_" in name or name == "informed" else "found",
            np.asarray(values, np.float32),
        )
        for name, (unit, label, values) in found.items()
        if values is not None
    }
    if solution.departures is not None:
        made |= _of_bursts(solution, solution.departures)
    if solution.velocity_m_s is not None:
        speed = np.linalg.norm(solution.velocity_m_s, axis=-1)
        made["speed"] = Volume("speed", "m s-1", "speed of the air", "derived", speed.astype(np.float32))
    return made


def _of_bursts(solution: Solution, found: Departures) -> dict[str, Volume]:
    """What is the same for every burst."""
    own_k, mean_k = found.temperature_std_k, solution.temperature_std_k
    whole_k = own_k if mean_k is None else np.hypot(own_k, mean_k)
    made: tuple[tuple[str, str, Kind, np.ndarray], ...] = (
        ("T_rms", "fluctuation of T from burst to burst, rms", "derived", found.rms_k),
        ("T_burst_std", "standard deviation of T in a burst", "uncertainty", whole_k),
        ("T_departure_std", "standard deviation of a burst's departure", "uncertainty", own_k),
    )
    return {
        name: Volume(name, "K", label, kind, np.asarray(values, np.float32))
        for name, label, kind, values in made
    }


# Fields of a sequence, of which each burst has its own: `T_burst.3` is that of the fourth.
MOVING = {"T_burst": "temperature in a burst", "T_departure": "T in a burst less the mean"}


def burst_volume(solution: Solution, name: str) -> Volume | None:
    """The field of one burst; None for a name that is no burst's, or a burst that is not there."""
    stem, _, number = name.partition(".")
    found = solution.departures
    if found is None or stem not in MOVING or not (number.isdecimal() or not number):
        return None
    burst = int(number or 0)
    if burst >= len(found.time_s):
        return None
    values = found.temperature_k[burst] + (solution.temperature_k if stem == "T_burst" else 0.0)
    return Volume(name, "K", MOVING[stem], "found", np.asarray(values, np.float32))


def moving_volumes(solution: Solution) -> list[Volume]:
    """The fields that move, all bursts behind one another along x: for their range."""
    found = solution.departures
    if found is None:
        return []
    bursts = [
        [volume for n in range(len(found.time_s)) if (volume := burst_volume(solution, f"{stem}.{n}"))]
        for stem in MOVING
    ]
    return [
        Volume(stem, "K", label, "found", np.concatenate([one.values for one in every]))
        for (stem, label), every in zip(MOVING.items(), bursts, strict=True)
    ]


def volumes_derived(derived: Sequence[Derived]) -> dict[str, Volume]:
    """Return what follows from a solution, and the ends of its intervals, by the names in result.nc."""
    found = {}
    for one in derived:
        low, high = one.low, one.high
        found[one.name] = Volume(one.name, one.unit, one.label, "derived", np.asarray(one.values, np.float32))
        for end, values in (("low", low), ("high", high)):
            if values is not None:
                name, label = f"{one.name}_{end}", f"{one.label}: 95 % interval, {_END[end]} end"
                found[name] = Volume(name, one.unit, label, "uncertainty", np.asarray(values, np.float32))
    return found


_END = {"low": "lower", "high": "upper"}


@dataclass(frozen=True)
class Shown:
    """A solution with every volume that can be looked at."""

    solution: Solution
    volumes: dict[str, Volume]


class SolutionCache:
    """The last few solutions; one that was written again is read again."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Path, int], Shown] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, path: Path, truth: Path | None) -> Shown:
        """Return the solution in `path`, beside the truth where there is one.

        Raises ApiError when there is no solution, BadInputError when one of them is damaged.
        """
        if not path.is_file():
            raise ApiError("not_found", "This result has no fields.")
        key = (path, path.stat().st_mtime_ns)
        with self._lock:
            # Imported here: xarray takes a second, and a service should answer before that. One request at a time:
            # two threads that import the same module at once may each see half of it.
            from app.experiment.results import read_derived, read_result
            from app.volume.comparison import beside_truth

            if key not in self._kept:
                solution = read_result(path)
                known = [] if truth is None else beside_truth(solution, truth)
                self._kept[key] = Shown(
                    solution,
                    volumes_of(solution) | volumes_derived(read_derived(path)) | volumes_beside(known),
                )
                while len(self._kept) > KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]


def volumes_beside(known: list[Beside]) -> dict[str, Volume]:
    """Return the truth and the error of every quantity."""
    found = {}
    for one in known:
        truth, error = (np.asarray(values, np.float32) for values in (one.truth, one.error))
        name = f"{one.name}_truth"
        found[name] = Volume(name, one.unit, f"true {one.label}", "truth", truth)
        name = f"{one.name}_error"
        found[name] = Volume(name, one.unit, f"{one.label}, found minus true", "error", error)
    return found


def cut(values: Float32[np.ndarray, "nx ny nz"], axis: Axis, index: int) -> Float32[np.ndarray, "rows cols"]:
    """Return one plane of vertices. Raises ApiError when there is none at `index`."""
    number = "xyz".index(axis)
    if not 0 <= index < values.shape[number]:
        raise ApiError(
            "invalid", f"There is no plane {index} along {axis}; expected 0 to {values.shape[number] - 1}."
        )
    return np.take(values, index, axis=number)


def pack(values: Float32[np.ndarray, "*shape"], encoding: Encoding) -> Packed:
    """Return numbers for the wire: u16 resolves 1/65535 of the range, f16 about 1/2000 of the largest.

    Where there is no air there is no value: NaN in floats, the largest number in u16.
    """
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if encoding == "f32":
        return Packed(values.astype("<f4").tobytes(), values.shape, 0.0, 1.0)
    if encoding == "f16":
        middle = (low + high) / 2
        return Packed((values - middle).astype("<f2").tobytes(), values.shape, middle, 1.0)
    empty = np.isnan(values)
    missing = _LARGEST if empty.any() else None
    scale = (high - low) / (_LARGEST if missing is None else _LARGEST - 1) or 1.0
    numbers = np.where(empty, _LARGEST, np.rint((values - low) / scale))
    return Packed(numbers.astype("<u2").tobytes(), values.shape, low, scale, missing)
