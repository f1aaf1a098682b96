"""Measured shifts as NetCDF: shift-<view>.nc of a result, for the report, the page, and other programs."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from app.errors import BadInputError
from app.files.durable import durable_path
from app.files.reading import reading
from core.geometry import Optics
from core.motion import MOTIONS, CameraMotion
from core.problem import ShiftMeasurement


def write_shifts(folder: Path, shifts: tuple[ShiftMeasurement, ...]) -> None:
    """Write one NetCDF a view: centres, displacement, information."""
    for index, shift in enumerate(shifts):
        with durable_path(folder / f"shift-{index}.nc") as temporary:
            _dataset(shift).to_netcdf(temporary, engine="h5netcdf")


def as_bytes(shift: ShiftMeasurement) -> bytes:
    """One view's shifts, as `write_shifts` writes them."""
    buffer = io.BytesIO()
    _dataset(shift).to_netcdf(buffer, engine="h5netcdf")
    return buffer.getvalue()


def of_bytes(content: bytes) -> ShiftMeasurement:
    """What `as_bytes` made."""
    with xr.open_dataset(io.BytesIO(content), engine="h5netcdf") as dataset:
        return _shift(dataset.load())


def _dataset(shift: ShiftMeasurement) -> xr.Dataset:
    pixel, component = {"units": "pixel"}, ("window", "component")
    dataset = xr.Dataset(
        {
            "centre": (component, shift.centres_px, pixel | {"long_name": "window centre"}),
            "displacement": (
                component,
                shift.displacement_px,
                pixel | {"long_name": "displacement of the pattern, to the right and down"},
            ),
            "information": (
                ("window", "component", "other"),
                shift.information_per_px2,
                {"units": "pixel-2", "long_name": "inverse covariance of the displacement"},
            ),
        },
        attrs={"Conventions": "CF-1.11", "window_px": shift.window_px} | _motion_attributes(shift.motion),
    )
    if shift.short_mean_px is not None:
        about = {"long_name": "errors of one standard deviation of a mean over a short time"}
        dataset["short_mean"] = (("window", "component", "error"), shift.short_mean_px, pixel | about)
    if shift.refused is not None:
        about = {"long_name": "1 where a window shows something else than the pattern, moved"}
        dataset["refused"] = ("window", shift.refused.astype(np.int8), about)
    return dataset


def _shift(data: xr.Dataset) -> ShiftMeasurement:
    return ShiftMeasurement(
        centres_px=data["centre"].to_numpy(),
        displacement_px=data["displacement"].to_numpy(),
        information_per_px2=data["information"].to_numpy(),
        window_px=int(np.asarray(data.attrs["window_px"])),
        refused=data["refused"].to_numpy().astype(bool) if "refused" in data else None,
        motion=_motion(data.attrs),
        short_mean_px=data["short_mean"].to_numpy() if "short_mean" in data else None,
    )


def _motion_attributes(motion: CameraMotion | None) -> dict[str, Any]:
    """The camera's unknown motion: its lens, and the motions of one standard deviation, one after the other."""
    if motion is None:
        return {}
    lens = motion.optics
    return {
        "picture_px": [lens.width_px, lens.height_px],
        "lens": [*lens.focal_px, *lens.principal_px, *lens.distortion],
        "camera_motions_px": motion.root_px.T.ravel(),
    }


def _motion(attributes: Mapping[str, Any]) -> CameraMotion | None:
    if "camera_motions_px" not in attributes:
        return None
    width_px, height_px = (int(v) for v in attributes["picture_px"])
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = (float(v) for v in attributes["lens"])
    # Where the camera stands does not matter to how its picture moves.
    lens = Optics(
        width_px=width_px, height_px=height_px, focal_px=(fx, fy), principal_px=(cx, cy),
        position_m=(0.0, 0.0, 0.0), rotation_rad=(0.0, 0.0, 0.0), distortion=(k1, k2, p1, p2, k3),
    )  # fmt: skip
    return CameraMotion(lens, np.reshape(attributes["camera_motions_px"], (-1, MOTIONS)).T)


def read_shifts(folder: Path) -> tuple[ShiftMeasurement, ...]:
    """Read what `write_shifts` wrote. Raises BadInputError."""
    shifts = []
    for path in sorted(folder.glob("shift-*.nc")):
        with reading(path, "Reconstruct again."):
            with xr.open_dataset(path, engine="h5netcdf") as dataset:
                data = dataset.load()
            shifts.append(_shift(data))
    if not shifts:
        raise BadInputError(f"{folder} holds no measured shifts; reconstruct again.")
    return tuple(shifts)
