"""Intrinsics of one device from board points: the lowest distortion order that the residuals justify.

Orders are nested (none, k1, k2, tangential, k3). A higher one is taken if it lowers
    numbers * log(mean square residual) + PENALTY * unknowns
and the rms by `WORTHWHILE`. The penalty lies between Akaike's 2 and Schwarz's log(numbers): a lens
coefficient that is left out turns the camera by as much as it hides (a tangential 6e-4 by 0.1 degrees),
one too many only widens the standard deviations. An order whose distortion turns back within the picture is
passed over: it has no direction for the pixels beyond, though it may fit boards that were not held there.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float

from calibration.adjustment import DISTORTION_MODELS, Adjusted, Device, Pose, Sighting, adjust
from calibration.board import fixes_pose
from calibration.errors import TooFewViewsError
from calibration.start import guess_intrinsics, guess_pose, guess_pose_and_error
from core.lens import has_direction

WORTHWHILE = 0.001
PENALTY = 3.0
OUTLIER_SIGMAS = 6.0
# Another order may fit worse by this much where the best one turns back within the picture.
WORSE = 1.5


# Only made-up pictures fit better; the logarithm needs a floor.
_PERFECT_PX = 1e-9


@dataclass(frozen=True)
class Intrinsics:
    """One device alone: what was adjusted, with which distortion model, from which sightings.

    `all_points_rms_px` is the rms of a fit to all points, `outliers` how many were then left out.
    """

    adjusted: Adjusted
    sightings: tuple[Sighting, ...]
    model: str
    rms_by_model_px: dict[str, float]
    outliers: int
    all_points_rms_px: float

    @property
    def device(self) -> Device:
        """The device, at the origin."""
        return self.adjusted.devices[0]

    @property
    def rms_px(self) -> float:
        """Root mean squared distance over all points."""
        return self.adjusted.rms_px(self.sightings)

    @property
    def std(self) -> Float[np.ndarray, "9"]:
        """Standard deviations of (fx, fy, cx, cy, k1, k2, p1, p2, k3); zero where fixed."""
        return np.sqrt(np.diag(self.adjusted.covariance))

    @property
    def view_rms_px(self) -> tuple[float, ...]:
        """Root mean squared distance of each view."""
        return tuple(float(np.sqrt(np.mean(np.sum(r**2, axis=1)))) for r in self.adjusted.residuals_px)


def fit_intrinsics(
    sightings: tuple[Sighting, ...],
    size_px: tuple[int, int],
    *,
    offset_lens: bool = False,
    models: tuple[str, ...] = tuple(DISTORTION_MODELS),
) -> Intrinsics:
    """Adjust one device (number 0); `offset_lens` also starts from principal points far off centre.

    Raises:
        TooFewViewsError: no distortion that fits has a direction for each pixel of the picture.
    """
    points = [s.points_m for s in sightings]
    pixels = [s.pixels_px for s in sightings]
    intrinsics = guess_intrinsics(points, pixels, size_px, offset_lens)
    poses = tuple(guess_pose(p, q, intrinsics) for p, q in zip(points, pixels, strict=True))
    fitted = _fit(intrinsics, poses, sightings, models, size_px)
    kept, outliers = _without_outliers(fitted, sightings, models[-1], size_px)
    if outliers:
        again = _fit(fitted.device.intrinsics, fitted.adjusted.poses, kept, models, size_px)
        fitted = replace(again, outliers=outliers, all_points_rms_px=fitted.rms_px)
    best_px = max(min(fitted.rms_by_model_px.values()), _PERFECT_PX)
    if not _shows_corners(fitted.device, size_px) or fitted.rms_px > WORSE * best_px:
        picture = "projector's panel" if offset_lens else "picture"
        raise TooFewViewsError(
            f"The distortion that fits the boards to {best_px:.2f} px turns back before the corners of the "
            f"{picture}, whose rays it does not tell. Add views with the board in these corners."
        )
    return fitted


def _shows_corners(device: Device, size_px: tuple[int, int]) -> bool:
    """Whether the lens has a direction for the picture's corners, and so for all that is nearer to its axis."""
    right, lower = size_px[0] - 0.5, size_px[1] - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [-0.5, lower], [right, lower]])
    return bool(has_direction(device.matrix, device.intrinsics[4:], corners).all())


def _fit(
    intrinsics: np.ndarray,
    poses: tuple[Pose, ...],
    sightings: tuple[Sighting, ...],
    models: tuple[str, ...],
    size_px: tuple[int, int],
) -> Intrinsics:
    """The chain of models, each from the one before."""
    numbers = 2 * sum(len(s.points_m) for s in sightings)
    tried: dict[str, tuple[float, float, Adjusted]] = {}
    for model in models:
        flags = DISTORTION_MODELS[model]
        start = np.concatenate([intrinsics[:4], np.where(flags, intrinsics[4:], 0.0)])
        device = Device(start, np.array([True] * 4 + list(flags)), np.zeros(3), np.zeros(3))
        adjusted = adjust((device,), poses, sightings)
        turned = _turned(adjusted, sightings)
        if any(new is not old for new, old in zip(turned, adjusted.poses, strict=True)):
            adjusted = adjust(adjusted.devices, turned, sightings)
        rms = adjusted.rms_px(sightings)
        free = 4 + sum(flags) + 6 * len(poses)
        tried[model] = (rms, numbers * np.log(max(rms, _PERFECT_PX) ** 2) + free * PENALTY, adjusted)
        intrinsics, poses = adjusted.devices[0].intrinsics, adjusted.poses
    whole = [m for m in models if _shows_corners(tried[m][2].devices[0], size_px)] or list(models)
    chosen = whole[0]
    for model in whole[1:]:
        better = tried[model][0] < (1 - WORTHWHILE) * tried[chosen][0]
        if better and tried[model][1] < tried[chosen][1]:
            chosen = model
    by_model = {m: float(t[0]) for m, t in tried.items()}
    return Intrinsics(tried[chosen][2], sightings, chosen, by_model, 0, by_model[chosen])


def _turned(adjusted: Adjusted, sightings: tuple[Sighting, ...]) -> tuple[Pose, ...]:
    """The poses, but the other one of the two that a plane allows where that fits better.

    A board that faces the device looks nearly the same tilted to either side; from a poor start the search
    may end in the wrong one, with a residual of some tenths of a pixel.
    """
    poses = list(adjusted.poses)
    intrinsics = adjusted.devices[0].intrinsics
    for sighting, residual in zip(sightings, adjusted.residuals_px, strict=True):
        pose, error = guess_pose_and_error(sighting.points_m, sighting.pixels_px, intrinsics)
        if error < 0.5 * float(np.sum(residual**2)):
            poses[sighting.view] = pose
    return tuple(poses)


def _without_outliers(
    fitted: Intrinsics, sightings: tuple[Sighting, ...], model: str, size_px: tuple[int, int]
) -> tuple[tuple[Sighting, ...], int]:
    """The sightings without points far outside the robust scatter; and how many those were.

    Wild points pull good ones along, so the worst go first (those beyond half the largest residual) and
    every point is judged again by the next fit.
    """
    kept = sightings
    for _ in range(10):
        distance = [_distance(fitted, s) for s in sightings]
        # The median of a Rayleigh distribution is 1.177 standard deviations of one axis.
        limit = OUTLIER_SIGMAS * max(float(np.median(np.concatenate(distance))) / 1.177, 1e-3)
        worst = max(float(_distance(fitted, s).max()) for s in kept)
        good = [d <= max(limit, worst / 2) for d in distance]
        kept = tuple(_chosen(s, g) for s, g in zip(sightings, good, strict=True))
        if worst <= limit:
            break
        fitted = _fit(fitted.device.intrinsics, fitted.adjusted.poses, kept, (model,), size_px)
    total, left = (sum(len(s.points_m) for s in group) for group in (sightings, kept))
    return kept, total - left


def _distance(fitted: Intrinsics, sighting: Sighting) -> Float[np.ndarray, " points"]:
    """Distance of each point from its prediction."""
    pose = fitted.adjusted.poses[sighting.view]
    device = fitted.device
    predicted, _ = cv2.projectPoints(
        sighting.points_m, pose.rotation_rad, pose.translation_m, device.matrix, device.intrinsics[4:]
    )
    return np.linalg.norm(np.asarray(predicted).reshape(-1, 2) - sighting.pixels_px, axis=1)


def _chosen(sighting: Sighting, good: Bool[np.ndarray, " points"]) -> Sighting:
    """The good points; all of them where too few would be left to place the board."""
    if good.sum() < 6 or good.all() or not fixes_pose(sighting.points_m[good]):
        return sighting
    return replace(sighting, points_m=sighting.points_m[good], pixels_px=sighting.pixels_px[good])
