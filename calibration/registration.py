"""How one picture moved against another, from the pixels of a mask alone: a similarity, to 0.01 px.

Gauss-Newton on the brightness difference (gain and offset free), the moved picture read by cubic
splines: OpenCV's own resampling rounds positions to 1/32 px, which is not enough here. Only masked
pixels are read, so a plume in the middle takes no part. Coarse (blurred) first, then fine.
Source: Baker & Matthews 2004, "Lucas-Kanade 20 years on" (inverse compositional).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Shaped
from scipy import ndimage

from calibration.errors import ImageError

MINIMUM_PIXELS = 500
_BLURS_PX = (3.0, 0.8)


@dataclass(frozen=True)
class FiniteSimilarity:
    """x' = centre + scale R(rotation) (x - centre) + shift: where the picture's content went [px]."""

    shift_px: Float[np.ndarray, "2"]
    rotation_rad: float
    scale: float
    centre_px: Float[np.ndarray, "2"]

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """The map of homogeneous (x, y, 1)."""
        c, s = np.cos(self.rotation_rad) * self.scale, np.sin(self.rotation_rad) * self.scale
        linear = np.array([[c, -s], [s, c]])
        matrix = np.eye(3)
        matrix[:2, :2] = linear
        matrix[:2, 2] = self.centre_px - linear @ self.centre_px + self.shift_px
        return matrix

    def displacement_px(self, points_px: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
        """x' - x."""
        return points_px @ (self.matrix[:2, :2] - np.eye(2)).T + self.matrix[:2, 2]


@dataclass(frozen=True)
class Registration:
    """The motion, the standard deviations of (shift x, shift y [px], rotation [rad], scale).

    `sector_px` is the largest shift that a sector of the mask has beyond the motion: well above
    `shift_std_px`, something else moved there.
    """

    motion: FiniteSimilarity
    std: Float[np.ndarray, "4"]
    sector_px: float
    iterations: int
    converged: bool

    @property
    def shift_std_px(self) -> float:
        """The larger standard deviation of the shift."""
        return float(max(self.std[:2]))


def register(
    reference: Shaped[np.ndarray, "_ _"],
    moved: Shaped[np.ndarray, "_ _"],
    mask: Bool[np.ndarray, "_ _"],
) -> Registration:
    """The similarity that carries `reference`'s content to `moved`'s, from the pixels in `mask`.

    Raises:
        ImageError: different sizes, a mask that is too small, or pictures without texture there.
    """
    if reference.shape != moved.shape or mask.shape != reference.shape:
        raise ImageError(
            f"The pictures are {reference.shape} and {moved.shape}, the mask {mask.shape}; expected one size."
        )
    if mask.sum() < MINIMUM_PIXELS:
        raise ImageError(f"The mask holds {mask.sum()} px; expected at least {MINIMUM_PIXELS}. Widen it.")
    if not (np.isfinite(reference).all() and np.isfinite(moved).all()):
        raise ImageError("A picture holds values that are not finite. Take both pictures again.")
    coarse, fine = (_Problem.of(reference, moved, mask, blur_px) for blur_px in _BLURS_PX)
    unknowns, _, _ = coarse.solve(np.zeros(4))
    unknowns, iterations, converged = fine.solve(unknowns)
    return fine.result(unknowns, iterations, converged)


def border_mask(shape: tuple[int, int], width_px: int) -> Bool[np.ndarray, "rows cols"]:
    """True within `width_px` of the picture's edge."""
    mask = np.ones(shape, bool)
    mask[width_px : shape[0] - width_px, width_px : shape[1] - width_px] = False
    return mask


@dataclass(frozen=True)
class _Problem:
    """One blur level: masked positions about the centre, reference values, their derivatives, a spline."""

    at: Float[np.ndarray, "pixels 2"]
    centre: Float[np.ndarray, "2"]
    values: Float[np.ndarray, " pixels"]
    jacobian: Float[np.ndarray, "pixels 6"]
    spline: Float[np.ndarray, "rows cols"]
    blur_px: float

    @staticmethod
    def of(reference: np.ndarray, moved: np.ndarray, mask: np.ndarray, blur_px: float) -> "_Problem":
        smooth = ndimage.gaussian_filter(reference.astype(float), blur_px)
        spline = ndimage.spline_filter(ndimage.gaussian_filter(moved.astype(float), blur_px))
        inner = mask & ~border_mask((mask.shape[0], mask.shape[1]), int(2 * blur_px) + 2)
        rows, cols = np.nonzero(inner)
        centre = np.array([(mask.shape[1] - 1) / 2, (mask.shape[0] - 1) / 2])
        at = np.stack([cols, rows], axis=1) - centre
        # Five-point derivatives: their error on a 4 px period is 4 %, which only slows convergence.
        kernel = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
        gx = ndimage.correlate1d(smooth, kernel, axis=1)[rows, cols]
        gy = ndimage.correlate1d(smooth, kernel, axis=0)[rows, cols]
        values = smooth[rows, cols]
        x, y = at.T
        jacobian = np.stack([gx, gy, x * gy - y * gx, x * gx + y * gy, values, np.ones(len(x))], axis=1)
        return _Problem(at, centre, values, jacobian, spline, blur_px)

    def solve(self, unknowns: np.ndarray) -> tuple[np.ndarray, int, bool]:
        """Iterate on (shift x, shift y, rotation, log scale) until the step is below 1e-5 px."""
        scale = np.linalg.norm(self.jacobian, axis=0)
        if scale[:2].min() <= 1e-9 * max(scale[4], 1e-300):
            raise ImageError("The mask holds no texture to register. Let pattern or marks reach into it.")
        gram = (self.jacobian / scale).T @ (self.jacobian / scale)
        reach = np.abs(self.at).max()
        for iteration in range(1, 51):
            difference = self._sample(unknowns) - self.values
            step = np.linalg.solve(gram, (self.jacobian / scale).T @ difference) / scale
            # Inverse compositional: the step moves the reference, so its inverse moves the picture.
            unknowns = unknowns - step[:4]
            if max(np.abs(step[:2]).max(), np.abs(step[2:4]).max() * reach) < 1e-5:
                return unknowns, iteration, True
        return unknowns, 50, False

    def _sample(self, unknowns: np.ndarray) -> np.ndarray:
        x, y = (self._similarity(unknowns).displacement_px(self.at + self.centre) + self.at + self.centre).T
        return ndimage.map_coordinates(self.spline, [y, x], order=3, prefilter=False, mode="mirror")

    def _similarity(self, unknowns: np.ndarray) -> FiniteSimilarity:
        return FiniteSimilarity(unknowns[:2], float(unknowns[2]), float(np.exp(unknowns[3])), self.centre)

    def result(self, unknowns: np.ndarray, iterations: int, converged: bool) -> Registration:
        difference = self._sample(unknowns) - self.values
        fit = np.linalg.lstsq(self.jacobian[:, 4:], difference, rcond=None)[0]
        left = difference - self.jacobian[:, 4:] @ fit
        rms = float(np.sqrt(np.mean(left**2)))
        # Blurred noise is alike over 4 pi blur^2 pixels, which are one measurement.
        scale = np.linalg.norm(self.jacobian, axis=0)
        inverse = np.linalg.inv((self.jacobian / scale).T @ (self.jacobian / scale)) / np.outer(scale, scale)
        std = rms * np.sqrt(np.diag(inverse)[:4] * max(4 * np.pi * self.blur_px**2, 1.0))
        return Registration(self._similarity(unknowns), std, self._sectors(left), iterations, converged)

    def _sectors(self, left: np.ndarray) -> float:
        """The largest shift left over in one of twelve sectors about the centre."""
        sector = ((np.arctan2(self.at[:, 1], self.at[:, 0]) + np.pi) / (2 * np.pi) * 12).astype(int) % 12
        largest = 0.0
        for number in range(12):
            chosen = sector == number
            if chosen.sum() < MINIMUM_PIXELS:
                continue
            columns = self.jacobian[np.ix_(chosen, [0, 1, 5])]
            shift = np.linalg.lstsq(columns, left[chosen], rcond=None)[0][:2]
            largest = max(largest, float(np.linalg.norm(shift)))
        return largest
