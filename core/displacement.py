"""How far the pattern moved between two images, per window, as sufficient statistics.

Model of a window, with the displacement d = (column, row) in px far below one pixel:

    I_flow = (1 + a) I_ref(x - d) + b   ~   I_ref - d . grad I + a I_ref + b

The gradient is that of the mean of both images, so its noise is uncorrelated with the noise of their
difference and the estimate has no first-order noise bias. Gain a and offset b (a lamp that drifts) are
marginalised. What is left is `core.problem.ShiftMeasurement`: a 2 x 2 information matrix a window.
Source: Lucas & Kanade (1981); the noise weighting is a weighted least-squares fit.

Cost: two 21-tap filters and fourteen window sums. Validity: |d| below a quarter of the finest period; a
larger common drift is taken out first (`remove_drift`).
"""

from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from core.problem import ShiftMeasurement
from core.scene import Scene, View
from core.setting import SettingError, check_range, setting

Image = Float[np.ndarray, "rows cols"]
AnyImage = Float[np.ndarray, "_ _"]

# A window without texture tells nothing: its displacement is 0 with this much information.
_LEAST_INFORMATION_PER_PX2 = 1e-6


def derivative_filter(half_taps: int = 10, highest_cycles_per_px: float = 0.4) -> Float[np.ndarray, " taps"]:
    """Antisymmetric taps c_k, sum 2 c_k sin(k w) = w: least squares of the relative error up to the limit.

    Within 0.1 % below 0.4 cycles a pixel. Central differences attenuate the gradient of a fine pattern
    (18 % at a period of 3 px, order 8), and the displacement grows by as much.
    """
    omega = np.linspace(1e-3, 2 * np.pi * highest_cycles_per_px, 400)
    sines = 2 * np.sin(np.outer(omega, np.arange(1, half_taps + 1))) / omega[:, None]
    half = np.linalg.lstsq(sines, np.ones_like(omega), rcond=None)[0]
    return np.concatenate([-half[::-1], [0.0], half])


def measure_shift(
    reference_image: AnyImage, flow_image: AnyImage, difference_variance: AnyImage | float, window_px: int
) -> ShiftMeasurement:
    """Displacement of every whole window of `window_px`, from the image edge on.

    `difference_variance` is the variance of one pixel of `flow_image - reference_image`, in the images'
    unit squared. Raises SettingError for unequal sizes, an image smaller than one window, or no noise.
    """
    check_pair(reference_image, flow_image, window_px)
    if not (np.isfinite(difference_variance).all() and np.min(difference_variance) > 0):
        raise SettingError(
            f"The images' noise has a variance down to {np.min(difference_variance):g}; expected finite values "
            "above 0. State full_well_e, read_noise_e and bits of the camera."
        )
    taps = derivative_filter()
    mean = 0.5 * (reference_image + flow_image)
    basis = (
        ndimage.correlate1d(mean, taps, axis=1, mode="nearest"),
        ndimage.correlate1d(mean, taps, axis=0, mode="nearest"),
        mean,
        np.ones_like(mean),
    )
    weight = np.broadcast_to(1.0 / np.asarray(difference_variance, np.float32), mean.shape)
    normal, score = _window_sums(basis, flow_image - reference_image, weight, window_px)
    information, rhs = _marginalise_gain(normal, score)
    information = information + _LEAST_INFORMATION_PER_PX2 * np.eye(2)
    return ShiftMeasurement(
        centres_px=window_centres(mean.shape, window_px),
        displacement_px=-np.linalg.solve(information, rhs[..., None])[..., 0],
        information_per_px2=information,
        window_px=window_px,
    )


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


@setting
class Similarity:
    """A small motion of the whole image about its centre: shift [px], rotation [rad], scale - 1."""

    column_px: float = 0.0
    row_px: float = 0.0
    rotation_rad: float = 0.0
    dilation: float = 0.0

    def displacement_px(
        self, points_px: Float[np.ndarray, "points 2"], shape: tuple[int, int]
    ) -> Float[np.ndarray, "points 2"]:
        """Displacement (column, row) of image points, to first order in the angle and the dilation."""
        return similarity_basis(points_px, shape) @ np.array(
            [self.column_px, self.row_px, self.rotation_rad, self.dilation]
        )

    def after(self, first: "Similarity") -> "Similarity":
        """Both motions, to first order."""
        return Similarity(
            column_px=self.column_px + first.column_px,
            row_px=self.row_px + first.row_px,
            rotation_rad=self.rotation_rad + first.rotation_rad,
            dilation=self.dilation + first.dilation,
        )


def similarity_basis(
    points_px: Float[np.ndarray, "points 2"], shape: tuple[int, int]
) -> Float[np.ndarray, "points 2 4"]:
    """Displacement by a unit of (column, row, rotation, dilation), about the image's centre."""
    x, y = (points_px - (np.array(shape[::-1]) - 1) / 2).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([one, zero, -y, x], -1), np.stack([zero, one, x, y], -1)], axis=-2)


def fit_similarity(
    measurement: ShiftMeasurement, static: np.ndarray, shape: tuple[int, int]
) -> tuple[Similarity, Float[np.ndarray, "4 4"]]:
    """Weighted fit over the windows where `static` is true: the motion and its covariance."""
    basis = similarity_basis(measurement.centres_px[static], shape)
    information = measurement.information_per_px2[static]
    weighted = np.einsum("wab,wbp->wap", information, basis)
    normal = np.einsum("wap,waq->pq", basis, weighted)
    # Scaled, since a radian moves a window by a thousand pixels.
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-10) / np.outer(scale, scale)
    solution = inverse @ np.einsum("wap,wa->p", weighted, measurement.displacement_px[static])
    column, row, rotation, dilation = (float(v) for v in solution)
    return Similarity(column_px=column, row_px=row, rotation_rad=rotation, dilation=dilation), inverse


def move_image(image: Image, motion: Similarity) -> Image:
    """`image` as it looks after `motion`, by a quintic spline (edges are repeated).

    Only a prediction is moved (the reference, to where the flow image should be); measured flow frames
    are never resampled.
    """
    centre = (np.array(image.shape) - 1) / 2
    c, s = np.cos(motion.rotation_rad), np.sin(motion.rotation_rad)
    # From output (row, column) to input: undo the motion.
    inverse = np.array([[c, -s], [s, c]]) / (1 + motion.dilation)
    shift = np.array([motion.row_px, motion.column_px])
    offset: Any = centre - inverse @ (centre + shift)
    return ndimage.affine_transform(image, inverse, offset=offset, order=5, mode="nearest")


def _window_sums(
    basis: tuple[Image, ...], difference: Image, weight: Image, window_px: int
) -> tuple[Float[np.ndarray, "windows k k"], Float[np.ndarray, "windows k"]]:
    rows, cols = (n // window_px for n in difference.shape)

    def sums(image: Image) -> Float[np.ndarray, " windows"]:
        whole = image[: rows * window_px, : cols * window_px]
        blocks = whole.reshape(rows, window_px, cols, window_px)
        # Rows of a window in float32, then float64: exact enough, and one pass over memory.
        return blocks.sum(axis=3).sum(axis=1, dtype=np.float64).ravel()

    size = len(basis)
    normal = np.empty((rows * cols, size, size))
    score = np.empty((rows * cols, size))
    for i in range(size):
        weighted = basis[i] * weight
        score[:, i] = sums(weighted * difference)
        for j in range(i + 1):
            normal[:, i, j] = normal[:, j, i] = sums(weighted * basis[j])
    return normal, score


def _marginalise_gain(
    normal: Float[np.ndarray, "windows 4 4"], score: Float[np.ndarray, "windows 4"]
) -> tuple[Float[np.ndarray, "windows 2 2"], Float[np.ndarray, "windows 2"]]:
    nuisance = normal[:, 2:, 2:]
    trace = np.trace(nuisance, axis1=1, axis2=2)[:, None, None]
    solved = np.linalg.solve(
        nuisance + 1e-9 * trace * np.eye(2),
        np.concatenate([normal[:, 2:, :2], score[:, 2:, None]], axis=2),
    )
    cross = normal[:, :2, 2:]
    return normal[:, :2, :2] - cross @ solved[..., :2], score[:, :2] - (cross @ solved[..., 2:])[..., 0]


def _size(image: np.ndarray) -> str:
    return " x ".join(str(n) for n in reversed(image.shape)) + " px"
