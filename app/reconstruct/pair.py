"""What is wrong with a pair of pictures as a whole, named before anything is measured on it.

A lamp that was off, a camera that was pushed, a lens out of focus or another exposure leave no measurement: each is
said, with what to take again. Nothing that was taken is lost.
"""

import numpy as np
from jaxtyping import Float, Float32
from scipy.ndimage import gaussian_filter, shift
from skimage.registration import phase_cross_correlation

from app.errors import BadInputError
from app.experiment.captures import MAX_SETTING_OFF, Capture
from core.displacement import REACH_PX

Image = Float32[np.ndarray, "rows cols"]

# One picture has at least this part of the other's light. Lamps age and warm up by a few percent.
_LEAST_LIGHT = 0.5
# A push is looked for in so much of the picture's middle.
_MIDDLE_PX = 2048
# One picture has at least this part of the other's fine structure: less is a blur of about half of its size.
_LEAST_SHARPNESS = 0.7


def check_pair(first: Capture, second: Capture, index: int, variance: Float[np.ndarray, "rows cols"]) -> None:
    """Raise BadInputError if view `index` of two captures cannot be compared.

    `variance` is that of the difference of the two mean pictures.
    """
    _same_settings(first, second, index)
    check_light(first, second, index)
    before, after = first.images[index].mean, second.images[index].mean
    moved_px = _moved_px(before, after)
    if np.hypot(*moved_px) > REACH_PX:
        raise BadInputError(
            f"Between {first.folder.name} ({first.role}) and {second.folder.name} ({second.role}) the whole picture "
            f"moved by {moved_px[0]:+.0f}, {moved_px[1]:+.0f} px (right, down); expected less than {REACH_PX:g} "
            "px. Something pushed the camera or its mount. Fix it, calibrate the camera's place again, and take "
            "both again."
        )
    sharp = [_fine_structure(one, 0.5 * float(variance.mean())) for one in (before, after)]
    if min(sharp) < _LEAST_SHARPNESS * max(sharp):
        soft = (first, second)[int(np.argmin(sharp))]
        raise BadInputError(
            f"{soft.folder.name}: the {soft.role} picture has {100 * min(sharp) / max(sharp):.0f} % of the fine "
            "structure of the other one; expected as much. It is out of focus, or the camera shook. Focus, fix the "
            "lens, and take both again."
        )


def check_light(first: Capture, second: Capture, index: int) -> None:
    """Raise BadInputError if view `index` of one of two captures was taken without its light."""
    dark, light = sorted((first, second), key=lambda one: float(one.images[index].mean.mean()))
    levels = [float(one.images[index].mean.mean()) for one in (dark, light)]
    if levels[0] < _LEAST_LIGHT * levels[1]:
        raise BadInputError(
            f"{dark.folder.name}: the {dark.role} picture has {100 * levels[0] / max(levels[1], 1e-9):.0f} % of the "
            f"light of the {light.role}; expected the same. Was a lamp or the projector off? Switch it on, let it "
            f"warm up, and take the {dark.role} again."
        )


def _same_settings(first: Capture, second: Capture, index: int) -> None:
    """Exposure and gain as granted; captures of another camera may not tell them."""
    granted = [
        {one["name"]: one["granted"] for one in capture.manifest["views"][index].get("settings", ())}
        for capture in (first, second)
    ]
    for name, was in granted[0].items():
        now = granted[1].get(name)
        if was is None or now is None or abs(now - was) <= MAX_SETTING_OFF * abs(was):
            continue
        raise BadInputError(
            f"{second.folder.name}: the {second.role} was taken with {name} {now:g}, and the {first.role} "
            f"({first.folder.name}) with {was:g}; expected the same. Take the {second.role} again with {was:g}."
        )


def _moved_px(before: Image, after: Image) -> tuple[float, float]:
    """By how many whole pixels (right, down) the picture moved; 0, 0 where standing still explains it better."""
    before, after = _middle(before), _middle(after)
    found, _, _ = phase_cross_correlation(after, before)
    moved = np.asarray(found, float)
    if not moved.any():
        return 0.0, 0.0
    if _alike(shift(before, moved, order=0, mode="nearest"), after) <= _alike(before, after):
        return 0.0, 0.0
    return float(moved[1]), float(moved[0])


def _middle(picture: Image) -> Image:
    rows, cols = (max(0, (length - _MIDDLE_PX) // 2) for length in picture.shape)
    return picture[rows : rows + _MIDDLE_PX, cols : cols + _MIDDLE_PX]


def _alike(one: Image, other: Image) -> float:
    """Correlation of two pictures without what is coarse."""
    fine = [picture - gaussian_filter(picture, 8.0) for picture in (one, other)]
    return float(
        np.sum(fine[0] * fine[1]) / max(float(np.linalg.norm(fine[0]) * np.linalg.norm(fine[1])), 1e-12)
    )


def _fine_structure(picture: Image, variance: float) -> float:
    """Rms of what a blur of one pixel takes away, without noise, over the picture's mean."""
    fine = picture - gaussian_filter(picture, 1.0)
    # Of white noise the blur of one pixel leaves 1 - 2 g(0) + sum g^2 = 0.76 of the variance.
    power = float(np.mean(fine**2)) - 0.76 * variance
    return float(np.sqrt(max(power, 0.0)) / max(float(picture.mean()), 1e-9))
