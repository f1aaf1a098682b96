"""Pictures of boards and walls under known optics: to practise a calibration, and to test it.

A look is worked out once (which paint and which projector pixel each camera sub-sample sees) and then
exposed under any panel image. Works backwards, from camera pixels to the world, where the calibration
works forwards; no shadows, no interreflection, no air. Luminance 0..1, without noise.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32, Shaped

from core.geometry import Optics
from core.lens import directions


@dataclass(frozen=True)
class Sheet:
    """A painted flat sheet: paint (0..1) with `px_per_m`, its paint pixel corner (0, 0) at `position_m`.

    The columns of `world_from_sheet` are the sheet's x (along the paint's columns), y (along its rows)
    and normal in the world. Beyond the paint the sheet ends, or goes on with the albedo `beyond`.
    """

    paint: Shaped[np.ndarray, "rows cols"]
    px_per_m: float
    position_m: Float[np.ndarray, "3"]
    world_from_sheet: Float[np.ndarray, "3 3"]
    beyond: float | None = None


@dataclass(frozen=True)
class Look:
    """What each sub-sample of each camera pixel sees: the paint, and where on the panel its light is from."""

    paint: Float32[np.ndarray, "rows cols samples"]
    panel_px: Float32[np.ndarray, "rows colsamples 2"] | None

    def expose(
        self, panel: Shaped[np.ndarray, "panel_rows panel_cols"] | None = None, ambient: float = 0.0
    ) -> Float32[np.ndarray, "rows cols"]:
        """Luminance under the panel image (0..1; none: dark) and ambient light (0..1).

        The panel is read bilinearly: a projector's pixel is soft by about its own size.
        """
        if panel is None or self.panel_px is None:
            return self.paint.mean(axis=2) * np.float32(ambient)
        x, y = self.panel_px[..., 0], self.panel_px[..., 1]
        lit = cv2.remap(np.asarray(panel, np.float32), x, y, cv2.INTER_LINEAR, borderValue=0.0)
        light = np.asarray(lit).reshape(self.paint.shape) + np.float32(ambient)
        return (self.paint * light).mean(axis=2)


def look(
    camera: Optics,
    sheets: tuple[Sheet, ...],
    projector: Optics | None = None,
    *,
    samples: int = 1,
    blur_px: float = 0.6,
) -> Look:
    """The camera's look at the sheets, the nearest in front, with `samples`**2 sub-samples a pixel.

    The paint is averaged over a sample's footprint and blurred by the lens, whose spot has the standard
    deviation `blur_px`, before it is sampled: otherwise edges would alias and corners move.
    """
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    y, x, dy, dx = np.meshgrid(
        np.arange(camera.height_px), np.arange(camera.width_px), offsets, offsets, indexing="ij"
    )
    pixels = np.stack([(x + dx).ravel(), (y + dy).ravel()], axis=1)
    shape = (camera.height_px, camera.width_px, samples**2)
    towards = rays_of(camera, pixels)
    origin = np.array(camera.position_m)
    depth = np.full(len(pixels), np.inf)
    paint = np.zeros(len(pixels), np.float32)
    for sheet in sheets:
        distance, colour = _meet(
            sheet, origin, towards, max(camera.focal_px), np.hypot(blur_px, 1 / (samples * np.sqrt(12)))
        )
        nearer = distance < depth
        depth[nearer], paint[nearer] = distance[nearer], colour[nearer]
    if projector is None:
        return Look(paint.reshape(shape), None)
    points_m = origin + np.where(np.isfinite(depth), depth, 1.0)[:, None] * towards
    panel = _panel_px(projector, points_m).reshape(camera.height_px, -1, 2)
    return Look(paint.reshape(shape), panel)


def rays_of(optics: Optics, pixels_px: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """World directions of pixels, with unit component along the optical axis."""
    return directions(_matrix(optics), np.array(optics.distortion), np.asarray(pixels_px)) @ optics.rotation


def _meet(
    sheet: Sheet, origin: np.ndarray, directions: np.ndarray, pixels_per_rad: float, spot_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance along each ray (inf: missed) and the paint there, blurred by `spot_px` camera pixels."""
    normal = sheet.world_from_sheet[:, 2]
    facing = directions @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((sheet.position_m - origin) @ normal) / facing
    hit = np.isfinite(distance) & (distance > 0)
    distance = np.where(hit, distance, 1.0)
    local = (origin + distance[:, None] * directions - sheet.position_m) @ sheet.world_from_sheet[:, :2]
    column, row = (local * sheet.px_per_m).T
    rows, cols = sheet.paint.shape
    inside = (column >= 0) & (column < cols) & (row >= 0) & (row < rows)
    paint = np.full(len(column), 0.0 if sheet.beyond is None else sheet.beyond, np.float32)
    seen = hit & inside
    middle_m = float(np.median(distance[seen])) if seen.any() else 0.0
    blurred = _averaged(sheet.paint, spot_px * middle_m * sheet.px_per_m / pixels_per_rad)
    paint[inside] = _bilinear(blurred, column[inside] - 0.5, row[inside] - 0.5)
    if sheet.beyond is None:
        hit &= inside
    return np.where(hit, distance, np.inf), paint


def _averaged(paint: np.ndarray, spot_paint_px: float) -> np.ndarray:
    """The paint in 0..1, blurred by a spot of this standard deviation [paint pixels]."""
    scaled = paint.astype(np.float32) * np.float32(1 / 255 if paint.dtype == np.uint8 else 1)
    return cv2.GaussianBlur(scaled, (0, 0), max(spot_paint_px, 0.1))


def _bilinear(paint: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    rows, cols = paint.shape
    column, row = np.clip(column, 0, cols - 1), np.clip(row, 0, rows - 1)
    left, top = (
        np.minimum(column.astype(int), max(cols - 2, 0)),
        np.minimum(row.astype(int), max(rows - 2, 0)),
    )
    right, bottom = np.minimum(left + 1, cols - 1), np.minimum(top + 1, rows - 1)
    u, v = (column - left).astype(np.float32), (row - top).astype(np.float32)
    above = paint[top, left] * (1 - u) + paint[top, right] * u
    below = paint[bottom, left] * (1 - u) + paint[bottom, right] * u
    return above * (1 - v) + below * v


def _panel_px(projector: Optics, points_m: np.ndarray) -> Float32[np.ndarray, "points 2"]:
    """Panel position (x, y) that lights each point; far off the panel behind the projector."""
    local = (points_m - np.array(projector.position_m)) @ projector.rotation.T
    pixels, _ = cv2.projectPoints(
        local, np.zeros(3), np.zeros(3), _matrix(projector), np.array(projector.distortion)
    )
    panel = np.asarray(pixels, np.float32).reshape(-1, 2)
    return np.where(local[:, 2:] > 0, panel, np.float32(-1e4))


def _matrix(optics: Optics) -> np.ndarray:
    (fx, fy), (cx, cy) = optics.focal_px, optics.principal_px
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
