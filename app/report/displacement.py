"""`displacement`: the shift field of any two pictures, for looking, and for shifts above a tenth of a pixel.

Farneback's polynomial expansion (OpenCV), with our own uncertainty: the covariance of a least-squares shift
of the local window, s^2 (sum grad I grad I^T)^-1, with s^2 the residual variance after the shift was undone.
The reconstruction does not use this; it works on `core.displacement`'s sufficient statistics.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import xarray as xr
from jaxtyping import Float, Float32

from app.files.durable import durable_path
from core.displacement import check_pair
from core.setting import SettingError

Image = Float32[np.ndarray, "rows cols"]

_BORDER = 0.08
_LEAST_TEXTURE = 1e-9
# Of a picture's contrast, by the other's: below it shows noise, or a light that was off.
_LEAST_CONTRAST = 0.05


@dataclass(frozen=True)
class ShiftField:
    """Displacement (column, row) of every pixel from reference to flow, one sigma of each, and the middle's drift."""

    displacement_px: Float32[np.ndarray, "rows cols 2"]
    std_px: Float32[np.ndarray, "rows cols 2"]
    drift_px: Float[np.ndarray, " 2"] | None


def shift_field(reference: Image, flow: Image, window_px: int = 21, remove_drift: bool = False) -> ShiftField:
    """Estimate the dense shift field. Raises SettingError for pictures that cannot be compared."""
    check_pair(reference, flow, window_px)
    _check_contrast(reference, flow)
    low, high = np.percentile(reference, [0.1, 99.9])
    scale = 255.0 / max(float(high - low), 1e-6)
    a, b = (np.clip((image - low) * scale, 0, 255).astype(np.float32) for image in (reference, flow))
    start = np.zeros((*a.shape, 2), np.float32)
    field = cv2.calcOpticalFlowFarneback(a, b, start, 0.5, 3, window_px, 5, 7, 1.5, 0)
    std = _standard_deviation(a, b, field, window_px)
    drift_px = None
    if remove_drift:
        drift_px, everywhere = _border_drift(field, std)
        field = field - everywhere
    return ShiftField(field.astype(np.float32), std, drift_px)


def _check_contrast(reference: Image, flow: Image) -> None:
    """Raises SettingError where a picture shows no pattern."""
    seen = {
        name: float(np.ptp(np.percentile(image, [0.1, 99.9])))
        for name, image in {"reference": reference, "flow": flow}.items()
    }
    most = max(seen.values())
    for name, contrast in seen.items():
        if contrast <= _LEAST_CONTRAST * most:
            share = f"{100 * contrast / most:.2g} % of the other's" if most else "none at all"
            raise SettingError(
                f"The {name} picture shows no pattern: its contrast is {share}. Give two pictures of the same "
                "pattern in the same light."
            )


def write_shift_field(path: Path, field: ShiftField, title: str) -> None:
    """Write a NetCDF of dx, dy and their standard deviations [px], rows down."""
    rows, cols = field.displacement_px.shape[:2]
    dims = ("row", "column")

    def variable(values: np.ndarray, long_name: str) -> tuple:
        return dims, values, {"units": "pixel", "long_name": long_name}

    dataset = xr.Dataset(
        {
            "dx": variable(field.displacement_px[..., 0], "displacement along columns, to the right"),
            "dy": variable(field.displacement_px[..., 1], "displacement along rows, downwards"),
            "dx_std": variable(field.std_px[..., 0], "standard deviation of dx"),
            "dy_std": variable(field.std_px[..., 1], "standard deviation of dy"),
        },
        {"row": np.arange(rows), "column": np.arange(cols)},
        {"Conventions": "CF-1.11", "title": title},
    )
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    with durable_path(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=encoding)


def _standard_deviation(a: Image, b: Image, field: np.ndarray, window_px: int) -> np.ndarray:
    rows, cols = np.indices(a.shape, dtype=np.float32)
    undone = cv2.remap(b, cols + field[..., 0], rows + field[..., 1], cv2.INTER_CUBIC)

    def local_mean(values: Image) -> Image:
        return cv2.GaussianBlur(values, (0, 0), window_px / 4)

    gx, gy = (cv2.Scharr(a, cv2.CV_32F, *order) / 32 for order in ((1, 0), (0, 1)))
    xx, yy, xy = local_mean(gx * gx), local_mean(gy * gy), local_mean(gx * gy)
    residual = local_mean((undone - a) ** 2)
    # Effective number of pixels under a Gaussian of sigma window / 4.
    members = 4 * np.pi * (window_px / 4) ** 2
    # Noise of a hundredth of a grey level at least; a flat window knows nothing, some tens of pixels.
    xx, yy = xx + _LEAST_TEXTURE, yy + _LEAST_TEXTURE
    determinant = np.maximum(xx * yy - xy**2, _LEAST_TEXTURE * (xx + yy) / 2)
    variance = np.stack([yy, xx], -1) * ((residual + 1e-4) / determinant / members)[..., None]
    return np.sqrt(variance).astype(np.float32)


def _border_drift(field: np.ndarray, std: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How the border's similarity moves the middle, and every pixel. Medians of blocks: a plume may cross it."""
    shape = field.shape[:2]
    step = max(4, min(shape) // 64)
    rows, cols = np.mgrid[step // 2 : shape[0] : step, step // 2 : shape[1] : step]
    centres = np.stack([cols.ravel(), rows.ravel()], -1).astype(float)
    edge = _BORDER * np.array(shape[::-1])
    border = np.any((centres < edge) | (centres > np.array(shape[::-1]) - edge), axis=1)
    values = field[rows.ravel(), cols.ravel()].astype(float)
    middle = np.median(values[border], axis=0)
    spread = 1.4826 * np.median(np.abs(values[border] - middle), axis=0) + 1e-3
    border &= np.all(np.abs(values - middle) < 4 * spread, axis=1)
    weight = 1.0 / std[rows.ravel(), cols.ravel()][border].astype(float)
    to_border = _similarities(centres[border], shape) * weight[..., None]
    drift = np.linalg.lstsq(to_border.reshape(-1, 4), (values[border] * weight).ravel(), rcond=None)[0]
    every_row, every_col = np.indices(shape)
    points = np.stack([every_col.ravel(), every_row.ravel()], -1).astype(float)
    return drift[:2], (_similarities(points, shape) @ drift).reshape(*shape, 2)


def _similarities(points_px: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """What a unit of shift across, down, rotation and magnification does to points, about the picture's middle."""
    half = max(shape) / 2
    x, y = ((points_px - (np.array(shape[::-1]) - 1) / 2) / half).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([one, zero, -y, x], -1), np.stack([zero, one, x, y], -1)], axis=-2)
