"""The noise of a shift before a picture is taken: the rendered pattern, the camera's noise, the window.

The information matrix of a window needs the reference image only, so it is the one that the measurement
will compute, from crops of the rendered reference. Cost: a few crops; error: what the print loses (README).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter

from core.camera_noise import frame_variance
from core.displacement import measure_shift, standard_deviation_px
from core.geometry import Optics, crop
from core.problem import ShiftMeasurement
from core.render import render_reference
from core.scene import Scene

# Fewer windows than this in a crop leave the filter's edge in most of them.
_WINDOWS_A_CROP = 6
# Information matrices nearer to singular than this know nothing of one direction: no pattern there.
_SINGULAR = 1e-6


@dataclass(frozen=True)
class ShiftNoise:
    """One standard deviation of a window's displacement (column, row), and what made it.

    `brightness` is the mean (1: full scale), `contrast` the relative rms, `gradient_per_px` the rms slope
    along the columns.
    """

    std_px: tuple[float, float]
    window_px: int
    brightness: float
    contrast: float
    gradient_per_px: float

    @property
    def mean_px(self) -> float:
        """Root mean square of both components."""
        return float(np.sqrt(np.mean(np.square(self.std_px))))


def shift_noise(scene: Scene, view: int, window_px: int) -> ShiftNoise:
    """Median over windows of five crops of the picture; windows without pattern are left out."""
    eye = scene.views[view]
    deviations, levels, contrasts, slopes = [], [], [], []
    for centre in ((0.5, 0.5), (0.2, 0.2), (0.8, 0.2), (0.2, 0.8), (0.8, 0.8)):
        cropped = replace(eye, camera=_crop(eye.camera, centre, _WINDOWS_A_CROP * window_px), marks=())
        views = tuple(cropped if i == view else v for i, v in enumerate(scene.views))
        image = np.clip(render_reference(replace(scene, views=views), view), 0.0, 1.0)
        if image.std() == 0.0 or min(image.shape) < window_px:
            continue
        # Both exposures carry the noise of their mean.
        variance = uniform_filter(frame_variance(image, eye.noise), 2 * window_px) * 2 / eye.frames
        measured = measure_shift(image, image, variance, window_px)
        matrix = measured.information_per_px2
        textured = np.linalg.det(matrix) > _SINGULAR * np.trace(matrix, axis1=1, axis2=2) ** 2
        if not textured.any():
            continue
        centres_px, displacement_px = measured.centres_px[textured], measured.displacement_px[textured]
        part = ShiftMeasurement(centres_px, displacement_px, matrix[textured], window_px)
        deviations.append(standard_deviation_px(part))
        levels.append(image.mean())
        contrasts.append(image.std() / image.mean())
        slopes.append(np.std(np.gradient(image, axis=1)))
    if not deviations:
        return ShiftNoise((np.inf, np.inf), window_px, 0.0, 0.0, 1e-12)
    column, row = np.median(np.concatenate(deviations), axis=0)
    means = (float(np.mean(values)) for values in (levels, contrasts, slopes))
    return ShiftNoise((float(column), float(row)), window_px, *means)


def _crop(camera: Optics, centre: tuple[float, float], side_px: int) -> Optics:
    parts: list[slice] = []
    for share, size in zip(centre[::-1], (camera.height_px, camera.width_px), strict=True):
        side = min(side_px, size)
        first = round(share * (size - side))
        parts.append(slice(first, first + side))
    return crop(camera, parts[0], parts[1])
