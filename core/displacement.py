"""How far the pattern moved between two pictures, per window, from a hundredth of the noise's limit to eight pixels.

Every window is fitted as if it had hardly moved (`core.window_fit`). Those that moved by more than a tenth of a pixel
are fitted again where they went; those that leave far more than the picture's usual window does are looked for by
whole pixels (`core.window_search`). What stays unexplained shows something else than the pattern, moved: a person, a
lamp's reflection. Such windows are refused. Source: Lucas & Kanade (1981), Gauss-Newton on the warped reference.

Cost: two 21-tap filters and one matrix of products a window; 0.1 ms for each window that moved far.
"""

from functools import cached_property

import jax
import numpy as np
from jaxtyping import Bool, Float

from core.problem import ShiftMeasurement
from core.scene import Scene, View
from core.setting import SettingError, check_range
from core.window_fit import WindowFit, fit_windows, gradients, window_products
from core.window_search import WindowSearch

AnyImage = Float[np.ndarray, "_ _"]

# Beyond this a window is fitted again where it went: a tenth of a pixel is 0.1 % wrong in a texture of 5 px.
_SMALL_PX = 0.1
# How far a window that no small shift explains is looked for, at most half of its width.
REACH_PX = 8
# A window is looked for where its best small shift leaves this share of the pattern's variance.
_LOST = 0.1
# A refused window leaves so many times the rms of the picture's median window,
_UNLIKE = 3.0
# or its pattern is so much fainter or brighter than in the reference, beside how the whole light changed.
_FAINT = 2.0


def measure_shift(
    reference_image: AnyImage,
    flow_image: AnyImage,
    difference_variance: AnyImage | float,
    window_px: int,
    *,
    follow: bool = True,
) -> ShiftMeasurement:
    """Displacement of every whole window of `window_px`, from the image edge on.

    `difference_variance` is the variance of one pixel of `flow_image - reference_image`, in the images'
    unit squared; each window takes its mean. Without `follow` every window is taken to have hardly moved. Raises
    SettingError for unequal sizes, an image smaller than one window, or no noise.
    """
    return ShiftOfPair(reference_image, flow_image, difference_variance, window_px).measured(follow=follow)


class ShiftOfPair:
    """Two pictures to be compared, as `measure_shift` takes them: what is worked out once serves both answers."""

    def __init__(
        self,
        reference_image: AnyImage,
        flow_image: AnyImage,
        difference_variance: AnyImage | float,
        window_px: int,
    ) -> None:
        check_pair(reference_image, flow_image, window_px)
        if not (np.isfinite(difference_variance).all() and np.min(difference_variance) > 0):
            raise SettingError(
                f"The images' noise has a variance down to {np.min(difference_variance):g}; expected finite values "
                "above 0. State full_well_e, read_noise_e and bits of the camera."
            )
        self._reference, self._flow, self._window_px = reference_image, flow_image, window_px
        variance = np.broadcast_to(np.asarray(difference_variance, float), reference_image.shape)
        self._variance = _blocks(variance, window_px).mean(axis=(1, 2))

    def measured(self, *, follow: bool) -> ShiftMeasurement:
        """The shift of every window; without `follow` as if each had hardly moved."""
        fit, centres = self._hardly_moved, window_centres(self._reference.shape, self._window_px)
        far = np.abs(fit.displacement_px).max(axis=1) > _SMALL_PX
        if follow and (far.any() or _lost(fit).any()):
            search = WindowSearch(self._reference, self._flow, self._window_px)
            fit = _followed(fit, far, search, centres, self._variance)
        light = float(np.mean(self._flow) / max(np.mean(self._reference), 1e-9))
        return ShiftMeasurement(
            centres_px=centres,
            displacement_px=fit.displacement_px,
            information_per_px2=fit.information_per_px2,
            window_px=self._window_px,
            refused=_unlike(fit, light),
        )

    @cached_property
    def _hardly_moved(self) -> WindowFit:
        return _hardly_moved(self._reference, self._flow, self._variance, self._window_px)


def _hardly_moved(
    reference_image: AnyImage, flow_image: AnyImage, variance: Float[np.ndarray, " windows"], window_px: int
) -> WindowFit:
    """Every window against the reference where it is; rows of windows one after the other, to spare memory."""
    mean = 0.5 * (reference_image + flow_image)
    pictures = (*gradients(mean), mean, flow_image - reference_image)
    rows = range(0, mean.shape[0] - window_px + 1, window_px)
    products = []
    for row in rows:
        column, down, level, difference = (
            _blocks(picture[row : row + window_px], window_px) for picture in pictures
        )
        products.append(window_products((column, down), level, difference))
    return fit_windows(np.concatenate(products), variance, window_px**2)


def _followed(
    fit: WindowFit,
    far: Bool[np.ndarray, " windows"],
    search: WindowSearch,
    centres_px: Float[np.ndarray, "windows 2"],
    variance: Float[np.ndarray, " windows"],
) -> WindowFit:
    """The windows that moved far, fitted where they went; those still unexplained, from the best whole pixel."""
    first = np.round(centres_px - (search.window_px - 1) / 2).astype(int)
    if far.any():
        fit = _replaced(fit, far, search.follow(first[far], fit.displacement_px[far], variance[far]))
    lost = _lost(fit)
    if lost.any():
        start = search.whole_pixels(first[lost], min(REACH_PX, search.window_px // 2))
        again = search.follow(first[lost], start, variance[lost])
        better = again.chi_squared < fit.chi_squared[lost]
        lost[lost] = better
        fit = _replaced(fit, lost, jax.tree.map(lambda values: values[better], again))
    return fit


def _lost(fit: WindowFit) -> Bool[np.ndarray, " windows"]:
    """Windows of which a small shift leaves a tenth of the pattern unexplained, beyond doubt."""
    return (fit.chi_squared > _UNLIKE**2) & (fit.chi_squared > _LOST * fit.contrast)


def _unlike(fit: WindowFit, light: float) -> Bool[np.ndarray, " windows"]:
    """Windows that show something else than the pattern, moved.

    They have lost the pattern, or leave more than the median of those that have not. Where most windows leave much
    of the pattern, these have lost it too: the median is no pattern then. `light` is the flow picture's mean over the
    reference's.
    """
    gain = fit.gain / max(light, 1e-9)
    gone = ~((gain > 1 / _FAINT) & (gain < _FAINT)) & (fit.information_per_px2.trace(axis1=1, axis2=2) > 1.0)
    if (gone | _lost(fit)).mean() > 0.5:
        gone |= _lost(fit)
    others = ~gone if not gone.all() else gone
    left = np.maximum(fit.chi_squared, 1.0)
    return gone | (left > _UNLIKE**2 * np.median(left[others]))


def _replaced(fit: WindowFit, where: Bool[np.ndarray, " windows"], new: WindowFit) -> WindowFit:
    def put(old: np.ndarray, part: np.ndarray) -> np.ndarray:
        both = old.copy()
        both[where] = part
        return both

    return jax.tree.map(put, fit, new)


def _blocks(image: Float[np.ndarray, "rows cols"], px: int) -> Float[np.ndarray, "windows px px"]:
    """The whole windows of a picture, row after row."""
    rows, columns = (n // px for n in image.shape)
    whole = image[: rows * px, : columns * px].reshape(rows, px, columns, px)
    return whole.transpose(0, 2, 1, 3).reshape(-1, px, px)


def check_pair(reference_image: np.ndarray, flow_image: np.ndarray, window_px: int) -> None:
    """Refuse a pair that cannot be compared (SettingError)."""
    check_range("window_px", window_px, 2, 4096, "px", "32 px serve a camera of 4096 px.")
    if reference_image.shape != flow_image.shape:
        raise SettingError(
            f"The reference is {_size(reference_image)} and the flow image {_size(flow_image)}; expected "
            "equal sizes. Take both with the same camera settings."
        )
    if min(reference_image.shape) < window_px:
        raise SettingError(
            f"The images are {_size(reference_image)}, smaller than one window of {window_px} px. "
            "Use a smaller window_px or larger images."
        )
    if not (np.isfinite(reference_image).all() and np.isfinite(flow_image).all()):
        raise SettingError("An image holds values that are not finite; take the images again.")


def window_centres(shape: tuple[int, int], window_px: int) -> Float[np.ndarray, "windows 2"]:
    """Centres (column, row) of the whole windows, row after row; pixel (0, 0) is the first's centre."""
    rows, cols = (np.arange(n // window_px) * window_px + (window_px - 1) / 2 for n in shape)
    return np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)


def resolve_window_px(scene: Scene, view: View) -> int:
    """The window: as given, or a 128th of the picture's width (fine enough for the grids that use it)."""
    if scene.solve.window_px != "auto":
        return scene.solve.window_px
    return int(np.clip(2 ** round(np.log2(view.camera.width_px / 128)), 8, 64))


def standard_deviation_px(measurement: ShiftMeasurement) -> Float[np.ndarray, "windows 2"]:
    """One sigma of each displacement component."""
    covariance = np.linalg.inv(measurement.information_per_px2)
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _size(image: np.ndarray) -> str:
    return " x ".join(str(n) for n in reversed(image.shape)) + " px"
