"""Results on disk: result.nc (NetCDF, CF names and units) and its way back into a `Solution`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from app.files.durable import durable_path
from app.files.reading import reading
from core.result import Departures, Derived, Outcome, Solution

_DIMS = ("x", "y", "z")
# The mark of a variable that follows from T and u.
_DERIVED = "derived from T and u and their deviations"

# The errors of T that all places share, along x, y, z and error.
_SHARED = "T_shared"
# Solution field -> (variable, units, CF standard name or '', long name)
_VOLUMES = {
    "temperature_k": ("T", "K", "air_temperature", "temperature"),
    "pressure_m2_s2": ("p", "m2 s-2", "", "kinematic pressure perturbation"),
    "temperature_std_k": ("T_std", "K", "", "standard deviation of the temperature"),
    "pressure_std_m2_s2": ("p_std", "m2 s-2", "", "standard deviation of the kinematic pressure"),
    "informed": ("informed", "1", "", "share of the prior variance of T that the measurements removed"),
}
_VECTORS = {
    "velocity_m_s": ("u", "velocity"),
    "velocity_std_m_s": ("u_std", "standard deviation of the velocity"),
}


def to_dataset(solution: Solution, attributes: dict[str, str], derived: Sequence[Derived] = ()) -> xr.Dataset:
    """The solution as a CF dataset: coordinates x, y, z [m]; T [K], p [m2 s-2], u, v, w [m s-1].

    The bursts of a sequence are along `time` [s]: T_departure is T in a burst less the mean's. Each of `derived` is
    there by its name, the ends of its interval as NAME_low and NAME_high.
    """
    coordinates = {
        axis: (
            axis,
            np.asarray(getattr(solution, f"{axis}_m"), np.float64),
            {"units": "m", "axis": axis.upper()},
        )
        for axis in _DIMS
    }
    variables = {}
    for name, (variable, units, standard, long) in _VOLUMES.items():
        values = getattr(solution, name)
        if values is not None:
            names = {"units": units, "long_name": long} | ({"standard_name": standard} if standard else {})
            variables[variable] = (_DIMS, np.asarray(values, np.float32), names)
    for name, (stem, long) in _VECTORS.items():
        values = getattr(solution, name)
        if values is not None:
            for i, axis in enumerate(_DIMS):
                names = {"units": "m s-1", "long_name": f"{long} along {axis}"}
                variables[_component(stem, i)] = (_DIMS, np.asarray(values[..., i], np.float32), names)
    if solution.temperature_shared_k is not None:
        names = {
            "units": "K",
            "long_name": "errors of T, one sigma each, that all places share; part of T_std",
        }
        variables[_SHARED] = ((*_DIMS, "error"), np.asarray(solution.temperature_shared_k, np.float32), names)
    for one in derived:
        for ending, long, values in _ends(one):
            names = {"units": one.unit, "long_name": long, "source": _DERIVED}
            variables[one.name + ending] = (_DIMS, np.asarray(values, np.float32), names)
    if solution.departures is not None:
        coordinates["time"] = _time(solution.departures, attributes.get("began", ""))
        variables |= _in_time(solution.departures)
    notes = {
        "Conventions": "CF-1.11",
        "outcome": solution.outcome.name,
        "solver_s": solution.solver_s,
        "notes": "\n".join(solution.notes),
    }
    return xr.Dataset(variables, coordinates, notes | attributes)


def _time(found: Departures, began: str) -> tuple[str, np.ndarray, dict[str, str]]:
    """The time axis of a sequence: CF's where the moment at which it began is told."""
    units = f"seconds since {began}" if began else "s"
    names = {"units": units, "axis": "T", "long_name": "time at which a burst began"}
    return "time", np.asarray(found.time_s, np.float64), names | ({"standard_name": "time"} if began else {})


def _in_time(found: Departures) -> dict[str, Any]:
    every, once = ("time", *_DIMS), _DIMS
    return {
        "T_departure": (
            every,
            np.asarray(found.temperature_k, np.float32),
            {"units": "K", "long_name": "temperature of a burst less that of the mean, T"},
        ),
        "T_departure_std": (
            once,
            np.asarray(found.temperature_std_k, np.float32),
            {
                "units": "K",
                "long_name": "standard deviation of T_departure, of every burst alike",
                "field_std_k": found.field_std_k,
                "field_length_m": found.field_length_m,
            },
        ),
        "T_rms": (
            once,
            np.asarray(found.rms_k, np.float32),
            {"units": "K", "long_name": "fluctuation of the temperature from burst to burst, rms"},
        ),
    }


def _departures(data: xr.Dataset) -> Departures | None:
    if "T_departure" not in data:
        return None
    about = data["T_departure_std"].attrs
    return Departures(
        time_s=data["time"].to_numpy().astype(np.float64),
        temperature_k=data["T_departure"].to_numpy(),
        temperature_std_k=data["T_departure_std"].to_numpy(),
        field_std_k=float(about["field_std_k"]),
        field_length_m=float(about["field_length_m"]),
    )


def _ends(one: Derived) -> list[tuple[str, str, np.ndarray]]:
    """What is kept of a derived quantity: the end of its name, its label, and its values."""
    parts = (
        ("", one.label, one.values),
        ("_low", f"{one.label}, lower end of its 95 % interval", one.low),
        ("_high", f"{one.label}, upper end of its 95 % interval", one.high),
    )
    return [(ending, label, values) for ending, label, values in parts if values is not None]


def write_result(
    path: Path, solution: Solution, attributes: dict[str, str], derived: Sequence[Derived] = ()
) -> None:
    """Write result.nc durably."""
    dataset = to_dataset(solution, attributes, derived)
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    with durable_path(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=encoding)


def read_result(path: Path) -> Solution:
    """Read result.nc. Raises BadInputError for a file that is not one."""
    with reading(path, "Reconstruct again, or give a result.nc."):
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
            data = dataset.load()
        fields: dict[str, Any] = {
            name: data[entry[0]].to_numpy() if entry[0] in data else None for name, entry in _VOLUMES.items()
        }
        for name, (stem, _) in _VECTORS.items():
            parts = [_component(stem, i) for i in range(3)]
            fields[name] = np.stack([data[p].to_numpy() for p in parts], -1) if parts[0] in data else None
        shape = tuple(data.sizes[axis] for axis in _DIMS)
        for name, values in fields.items():
            _check(name, values, (*shape, 3) if name in _VECTORS else shape)
        shared_k = data[_SHARED].to_numpy() if _SHARED in data else None
        _check(_SHARED, shared_k, (*shape, data.sizes.get("error", 0)))
        return Solution(
            x_m=data["x"].to_numpy(),
            y_m=data["y"].to_numpy(),
            z_m=data["z"].to_numpy(),
            outcome=Outcome[str(data.attrs["outcome"])],
            solver_s=float(data.attrs["solver_s"]),
            notes=tuple(str(data.attrs["notes"]).splitlines()),
            departures=_departures(data),
            temperature_shared_k=shared_k,
            **fields,
        )


def read_derived(path: Path) -> tuple[Derived, ...]:
    """What follows from the solution in result.nc, as it was kept beside it. Raises BadInputError."""
    with reading(path, "Reconstruct again, or give a result.nc."):
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            kept = [str(name) for name, one in dataset.items() if one.attrs.get("source") == _DERIVED]
            data = dataset[kept].load()

    def values(name: str) -> np.ndarray | None:
        return data[name].to_numpy() if name in data else None

    return tuple(
        Derived(
            name,
            data[name].attrs["units"],
            data[name].attrs["long_name"],
            data[name].to_numpy(),
            values(f"{name}_low"),
            values(f"{name}_high"),
        )
        for name in kept
        if not name.endswith(("_low", "_high"))
    )


def _check(name: str, values: np.ndarray | None, shape: tuple[int, ...]) -> None:
    """NaN is no value; every field has some, and none is infinite."""
    if values is None:
        return
    if values.shape != shape or np.isinf(values).any() or np.isnan(values).all():
        raise ValueError(f"{name} has shape {values.shape}; expected finite values of shape {shape}")


def _component(stem: str, index: int) -> str:
    """u, v, w and u_std, v_std, w_std."""
    return "uvw"[index] + stem[1:]
