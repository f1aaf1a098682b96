"""Regimes: which of the paper's losses a solve uses, and how they weigh. A regime is a list of losses."""

from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from core.continuity import left_out, moved_as_air
from core.data_error import WALL_MARGIN
from core.drift import nearly_still
from core.losses.boundary_loss import boundary_loss, level_loss, point_losses
from core.losses.image_rows import pixel_centres, rendered_rows, warped_rows
from core.losses.physics import Loss, PhysicsLoss, PriorLoss, SmoothnessLoss
from core.losses.shifts import ShiftLoss, ShiftRows, displacement_rows
from core.losses.traced import TracedLoss, rendered_view, traced_windows
from core.motion import MOTIONS, CameraMotion
from core.problem import ImagePair, Problem, ShiftMeasurement
from core.rays.operator import build
from core.rays.visibility import away_from_walls
from core.scene import Scene
from core.setting import SettingError, setting
from core.solve.nondimensional import RoomFrame, height_profile

Regime = Literal["bos+boundary", "pde+boundary", "bos+pde+boundary"]
# Prior slopes of T across and along the view.
_ACROSS_K_M, _ALONG_K_M = 30.0, 1.0
REGIMES: tuple[Regime, ...] = ("bos+boundary", "pde+boundary", "bos+pde+boundary")


@setting
class Weights:
    """λ of the image, boundary and physics losses; γ of mass, momentum, heat within the last.

    Each loss is a mean of squares: of errors over the noise, of errors over the largest boundary value,
    of dimensionless residuals. λ is therefore one over the mean square at which a term is satisfied:
    one sigma of noise, about a hundredth of the boundary values, a few hundredths of U²/L. `smoothness`
    weighs a prior on the slopes of T (30 K/m across the view, 1 K/m along it), about a hundredth of the images.
    """

    bos: float = 1.0
    boundary: float = 1e4
    pde: float = 1e3
    gamma: tuple[float, float, float] = (1.0, 1.0, 1.0)
    smoothness: float = 0.015


@setting
class DataModel:
    """Which windows the data term leaves out, and its representation error.

    `representation` is the part of the shifts' size that the model's grid cannot hold, added to the
    noise. Windows whose shift is `outlier` times the typical one (a thermal layer beside a wall, thinner
    than a cell) are left out, and so are those within `margin` of the room's size from a side wall, floor
    or ceiling.
    """

    representation: float = 0.1
    outlier: float = 6.0
    margin: float = WALL_MARGIN


def losses_of(
    problem: Problem,
    frame: RoomFrame,
    regime: str,
    weights: Weights,
    data: DataModel,
    shape: tuple[int, int, int],
    wall_points: int,
    traced_steps: int | None = None,
) -> tuple[Loss, ...]:
    """The losses of a regime; temperature for the image loss is taken on a vertex grid of `shape`.

    With `traced_steps` the rays go through the representation itself, with so many steps each.
    """
    if regime not in REGIMES:
        raise SettingError(f"There is no regime {regime!r}; expected one of {', '.join(REGIMES)}.")
    losses: list[Loss] = []
    if "bos" in regime:
        if traced_steps is None:
            losses.append(image_loss(problem, frame, weights.bos, data, shape))
        else:
            losses.append(traced_loss(problem, frame, weights.bos, data, traced_steps))
        if weights.smoothness > 0:
            losses.append(_smoothness(problem, frame, weights.smoothness, shape))
    boundary = boundary_loss(problem, frame, weight=weights.boundary, points_an_axis=wall_points)
    if boundary.patches:
        losses.append(boundary)
    losses += point_losses(problem, frame)
    level = level_loss(problem, frame, wall_points)
    if level is not None:
        losses.append(level)
    if "pde" in regime:
        losses.append(PhysicsLoss(frame.numbers, frame.lower, frame.upper, weights.pde, weights.gamma))
    if moved(problem):
        units = tuple(_unit(nearly_still(shift)) for shift in problem.shifts)
        losses.append(PriorLoss(tuple(1.0 / unit for unit in units)))
    return tuple(losses)


def _smoothness(
    problem: Problem, frame: RoomFrame, weight: float, shape: tuple[int, int, int]
) -> SmoothnessLoss:
    spans = frame.vertices(shape)
    per_nd = frame.scales.length_m / abs(frame.scales.excess_k)
    across, along = _ACROSS_K_M * per_nd, _ALONG_K_M * per_nd
    return SmoothnessLoss(
        spans, height_profile(problem, frame, spans).temperature, (across, along, across), weight
    )


def image_loss(
    problem: Problem, frame: RoomFrame, weight: float, data: DataModel, shape: tuple[int, int, int]
) -> ShiftLoss:
    """The data term of every view, as the scene names it; `auto` takes the windows' displacements."""
    scene = problem.scene
    match scene.solve.data_term:
        case "rendered" | "warped" as term:
            rows = rendered_rows if term == "rendered" else warped_rows
            views = [
                _inner(rows(scene, v, pair, shape, _motion_of(problem, v)), scene, v, pair, data)
                for v, pair in enumerate(problem.images)
            ]
        case _:
            views = [_windows(problem, v, data, shape) for v in range(len(problem.shifts))]
    return ShiftLoss(tuple(views), frame.vertices(shape), frame.scales, scene.air, weight)


def traced_loss(problem: Problem, frame: RoomFrame, weight: float, data: DataModel, steps: int) -> TracedLoss:
    """The paper's data term of every view: rendered where there are samples, else the windows' shifts."""
    scene = problem.scene
    if scene.solve.data_term == "rendered":
        views = [rendered_view(scene, v, pair) for v, pair in enumerate(problem.images)]
    else:
        views = [
            traced_windows(scene, v, *_kept_windows(problem, v, data)) for v in range(len(problem.shifts))
        ]
    return TracedLoss(tuple(views), frame.scales, scene.air, scene.room.lower_m, steps, weight)


def _inner(rows: ShiftRows, scene: Scene, view: int, pair: ImagePair, data: DataModel) -> ShiftRows:
    """The rows of the pixels away from the walls and their thermal layers."""
    centres_px = pixel_centres(*pair.flow_image.shape)
    used = _away_from_walls(scene, view, centres_px, data.margin, np.ones(len(centres_px), bool))
    return rows.chosen(jnp.asarray(np.flatnonzero(used)))


def _windows(problem: Problem, view: int, data: DataModel, shape: tuple[int, int, int]) -> ShiftRows:
    kept, model_std_px, motions = _kept_windows(problem, view, data)
    operator = build(problem.scene, view, kept.centres_px, shape, window_px=float(kept.window_px))
    return displacement_rows(kept, operator, motions, model_std_px)


def moved(problem: Problem) -> bool:
    """Whether the camera may have moved between the exposures."""
    return any(shift.motion is not None for shift in problem.shifts)


def _unit(shift: ShiftMeasurement) -> float:
    """The unit of the unknown motion in its standard deviations: at most about the size of the shifts.

    A descent by gradients takes steps of one size in all unknowns.
    """
    if shift.motion is None:
        return 1.0
    typical_px = float(np.median(np.linalg.norm(shift.displacement_px, axis=1)))
    return min(1.0, typical_px / max(float(np.abs(shift.motion.root_px).max()), 1e-12))


def _motion_of(problem: Problem, view: int) -> CameraMotion:
    """What a unit of the view's unknown motion is; nothing where the camera stood still."""
    root_px = np.zeros((MOTIONS, MOTIONS))
    if view < len(problem.shifts):
        shift = nearly_still(problem.shifts[view])
        if shift.motion is not None:
            root_px = _unit(shift) * shift.motion.root_px
    return CameraMotion(problem.scene.views[view].camera, root_px)


def _kept_windows(
    problem: Problem, view: int, data: DataModel
) -> tuple[ShiftMeasurement, float, Float[np.ndarray, "windows 2 6"]]:
    """Windows that the grid can represent, the representation error in px, and what units of motion do to them."""
    shift = nearly_still(problem.shifts[view])
    used, model_std_px = _usable(shift, data)
    used &= _as_air(problem, view)
    used = _away_from_walls(problem.scene, view, shift.centres_px, data.margin, used)
    kept = shift.at(used)
    return kept, model_std_px, _motion_of(problem, view).at(kept.centres_px)


def _as_air(problem: Problem, view: int) -> Bool[np.ndarray, " windows"]:
    shift = problem.shifts[view]
    return moved_as_air(shift, away_from_walls(problem.scene, view, shift.centres_px, 0.0))


def windows_left_out(problem: Problem, regime: Regime) -> tuple[str, ...]:
    """A sentence on the windows that did not move as air does; none without any, or where no images are used."""
    views = () if regime == "pde+boundary" else range(len(problem.shifts))
    return left_out([_as_air(problem, view) for view in views])


def _usable(shift: ShiftMeasurement, data: DataModel) -> tuple[np.ndarray, float]:
    """Windows to keep, and the representation error in px."""
    size = np.linalg.norm(shift.displacement_px, axis=1)
    noise = np.sqrt(np.trace(np.linalg.inv(shift.information_per_px2), axis1=1, axis2=2))
    # First without windows that have no texture: beside the wall those give shifts of hundreds of pixels.
    textured = noise < 1.0
    if not textured.any():
        raise SettingError(
            "No window of a picture knows its shift along both directions to a pixel, as where a pattern is of "
            "stripes. Use a pattern with texture in both directions."
        )
    seen = size[textured]
    typical = float(np.sqrt(np.mean(np.minimum(seen, np.percentile(seen, 90)) ** 2)))
    return textured & (size < data.outlier * typical + 6 * noise), data.representation * typical


def _away_from_walls(
    scene: Scene,
    view: int,
    centres_px: Float[np.ndarray, "places 2"],
    margin: float,
    used: Bool[np.ndarray, " places"],
) -> Bool[np.ndarray, " places"]:
    """Which of those used lie further than `margin` from the back wall's edges. Raises SettingError if none."""
    inside = used & away_from_walls(scene, view, centres_px, margin)
    if not inside.any():
        raise SettingError(
            f"View {scene.views[view].name!r} sees nothing of the room away from its walls. "
            "Check that the back wall is inside the picture."
        )
    return inside
