"""Regimes: which of the paper's losses a solve uses, and how they weigh. A regime is a list of losses."""

from typing import Literal

import numpy as np

from core.boundary import boundary_loss, point_losses
from core.losses import Loss, PhysicsLoss, PriorLoss
from core.problem import Problem, ShiftMeasurement
from core.rays.operator import build
from core.setting import SettingError, setting
from core.shift_loss import ShiftLoss, displacement_rows, similarity_basis
from core.solve.frame import Frame

Regime = Literal["bos+boundary", "pde+boundary", "bos+pde+boundary"]
REGIMES: tuple[Regime, ...] = ("bos+boundary", "pde+boundary", "bos+pde+boundary")


@setting
class Weights:
    """λ of the image, boundary and physics losses; γ of mass, momentum, heat within the last.

    Each loss is a mean of squares: of errors over the noise, of errors over the largest boundary value,
    of dimensionless residuals. λ is therefore one over the mean square at which a term is satisfied:
    one sigma of noise, about a hundredth of the boundary values, a few hundredths of U²/L.
    """

    bos: float = 1.0
    boundary: float = 1e4
    pde: float = 1e3
    gamma: tuple[float, float, float] = (1.0, 1.0, 1.0)


@setting
class DataModel:
    """What the data term leaves out or cannot represent.

    `representation` is the part of the shifts' size that the model's grid cannot hold, added to the
    noise. Windows whose shift is `outlier` times the typical one (a thermal layer beside a wall, thinner
    than a cell) are left out. `drift_std_px` is None where the images are known to be still.
    """

    representation: float = 0.05
    outlier: float = 6.0
    drift_std_px: float | None = None


def losses_of(
    problem: Problem,
    frame: Frame,
    regime: Regime,
    weights: Weights,
    data: DataModel,
    shape: tuple[int, int, int],
    wall_points: int,
) -> tuple[Loss, ...]:
    """The losses of a regime; temperature for the image loss is taken on a vertex grid of `shape`."""
    if regime not in REGIMES:
        raise SettingError(f"There is no regime {regime!r}; expected one of {', '.join(REGIMES)}.")
    losses: list[Loss] = []
    if "bos" in regime:
        losses.append(image_loss(problem, frame, weights.bos, data, shape))
    boundary = boundary_loss(problem, frame, weight=weights.boundary, points_an_axis=wall_points)
    if boundary.patches:
        losses.append(boundary)
    losses += point_losses(problem, frame)
    if "pde" in regime:
        losses.append(PhysicsLoss(frame.numbers, frame.lower, frame.upper, weights.pde, weights.gamma))
    if data.drift_std_px is not None or problem.scene.flow.transport == "learned":
        losses.append(PriorLoss(drift_std_px=data.drift_std_px or 0.3))
    return tuple(losses)


def image_loss(
    problem: Problem, frame: Frame, weight: float, data: DataModel, shape: tuple[int, int, int]
) -> ShiftLoss:
    """The displacement data term of every view."""
    views = []
    for view, shift in enumerate(problem.shifts):
        camera = problem.scene.views[view].camera
        used, model_std_px = _usable(shift, data)
        kept = type(shift)(
            shift.centres_px[used],
            shift.displacement_px[used],
            shift.information_per_px2[used],
            shift.window_px,
        )
        operator = build(problem.scene, view, kept.centres_px, shape, window_px=float(kept.window_px))
        basis = similarity_basis(kept.centres_px, (camera.width_px, camera.height_px))
        views.append(displacement_rows(kept, operator, basis, model_std_px))
    return ShiftLoss(tuple(views), frame.vertices(shape), frame.scales, problem.scene.air, weight)


def _usable(shift: ShiftMeasurement, data: DataModel) -> tuple[np.ndarray, float]:
    """Windows to keep, and the representation error in px."""
    size = np.linalg.norm(shift.displacement_px, axis=1)
    noise = np.sqrt(np.trace(np.linalg.inv(shift.information_per_px2), axis1=1, axis2=2))
    # Windows without texture first: beside the wall they draw shifts of hundreds of pixels.
    textured = noise < 1.0
    seen = size[textured]
    typical = float(np.sqrt(np.mean(np.minimum(seen, np.percentile(seen, 90)) ** 2)))
    return textured & (size < data.outlier * typical + 6 * noise), data.representation * typical
