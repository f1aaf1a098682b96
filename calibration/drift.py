"""What moved between two exposures: the camera (everything moves) or the projector (only the light moves).

Printed marks on the wall follow the camera alone; the projected border follows both. So the camera's
motion is registered on the marks, the sum on the border, and the projector's is what is left.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Shaped

from calibration.registration import FiniteSimilarity, Registration, register

# A sector this many times beyond its noise says that air moved in the border.
_SUSPICIOUS = 6.0


@dataclass(frozen=True)
class Drift:
    """`total` is what the pattern did; `camera` and `projector` are its parts where marks were given."""

    total: Registration
    camera: Registration | None
    projector: FiniteSimilarity | None
    advice: tuple[str, ...]


def measure_drift(
    reference: Shaped[np.ndarray, "_ _"],
    flow: Shaped[np.ndarray, "_ _"],
    border: Bool[np.ndarray, "_ _"],
    marks: Bool[np.ndarray, "_ _"] | None = None,
) -> Drift:
    """Register the pattern's border and, if `marks` are given, the printed marks.

    Raises:
        ImageError: as `register`.
    """
    total = register(reference, flow, border if marks is None else border & ~marks)
    camera = None if marks is None else register(reference, flow, marks)
    projector = None if camera is None else _after(camera.motion, total.motion)
    return Drift(total, camera, projector, _advice(total, camera))


def _after(camera: FiniteSimilarity, total: FiniteSimilarity) -> FiniteSimilarity:
    """The motion that turns the camera's into the total: total = projector o camera."""
    matrix = total.matrix @ np.linalg.inv(camera.matrix)
    scale = float(np.hypot(matrix[0, 0], matrix[1, 0]))
    rotation = float(np.arctan2(matrix[1, 0], matrix[0, 0]))
    centre = total.centre_px
    return FiniteSimilarity(matrix[:2, :2] @ centre + matrix[:2, 2] - centre, rotation, scale, centre)


def _advice(total: Registration, camera: Registration | None) -> tuple[str, ...]:
    advice = []
    if not total.converged:
        advice.append("The border did not register: the pictures differ too much. Take the reference again.")
    if total.sector_px > max(_SUSPICIOUS * total.shift_std_px, 0.02):
        advice.append(
            f"Part of the border moved by {total.sector_px:.3f} px on its own: air or a loose print. "
            "Choose a border that the flow does not cross."
        )
    moved = float(np.linalg.norm(total.motion.shift_px))
    if moved > 1.0:
        advice.append(f"The pattern moved by {moved:.2f} px. Fix camera and projector, then take both again.")
    if camera is None and moved > 0.05:
        advice.append(
            f"The pattern moved by {moved:.3f} px; camera and projector cannot be told apart. "
            "Stick printed marks to the wall and name their boxes."
        )
    return tuple(advice)
