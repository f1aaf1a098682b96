"""What the camera may have done between the exposures: a small motion of the whole picture that nobody knows.

A mount creeps, a lens breathes. The camera then turns, rolls and magnifies, and its sensor is carried behind the
lens. That hides a part of what the air does (a linear profile of temperature moves the whole picture by one vector).
The shifts d of the windows therefore have the covariance

    C = information^-1 + B B^T,     B: the motions of one standard deviation, at the windows.

`WithoutMotion` is the exact way to use C in a solver that knows windows with errors of their own: applied to what was
measured and to what a model predicts alike, it makes the weighted sum of squares of their difference r^T C^-1 r. The
motion is then neither fitted nor assumed; it is marginalised.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.geometry import Optics
from core.lens import on_plane, seen_at

MOTIONS = 6
# Step of a difference on the plane at distance 1.
_STEP = 1e-4

Shifts = Float[np.ndarray, "windows 2"]


def motion_basis(points_px: Float[np.ndarray, "points 2"], optics: Optics) -> Float[np.ndarray, "points 2 6"]:
    """Displacement of points (column, row) of a picture by a unit of each of the camera's six motions.

    In order: the sensor is carried behind the lens, to the right and down [px]; the focal length grows [px at the
    picture's edge]; the camera rolls [px at the edge], and turns sideways and up or down [px on the optical axis].
    What a turn moves goes further at the picture's edges than in its middle: by 1 + x^2 along x and x y along y, on
    the plane at distance 1 before the lens.
    """
    centre, half = np.array(optics.principal_px), max(optics.width_px, optics.height_px) / 2
    plane = on_plane(optics, points_px)
    x, y = plane.T
    rolled = np.stack([-y, x], -1) / half
    turned = np.stack([1.0 + x * x, x * y], -1), np.stack([x * y, 1.0 + y * y], -1)
    one, zero = np.ones_like(x), np.zeros_like(x)

    def through_lens(way: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
        ahead, behind = (seen_at(optics, plane + step * way) for step in (_STEP, -_STEP))
        return (ahead - behind) / (2.0 * _STEP)

    columns = [
        np.stack([one, zero], -1),
        np.stack([zero, one], -1),
        (points_px - centre) / half,
        through_lens(rolled),
        *(through_lens(way / f) for way, f in zip(turned, optics.focal_px, strict=True)),
    ]
    return np.stack(columns, axis=-1)


class CameraMotion(eqx.Module):
    """The unknown motion of one view's camera.

    The columns of `root_px` are independent motions of one standard deviation, each as the six of `motion_basis`. The
    motion's covariance is root_px root_px^T.
    """

    optics: Optics = eqx.field(static=True)
    root_px: Float[np.ndarray, "6 motions"]

    def at(self, points_px: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2 motions"]:
        """What each motion of one standard deviation does at points (column, row)."""
        return motion_basis(points_px, self.optics) @ self.root_px


class WithoutMotion(eqx.Module):
    """Takes the motion, or another error that the windows share, out of shifts: s - out (along^T s)."""

    out: Float[np.ndarray, "windows 2 motions"]
    along: Float[np.ndarray, "windows 2 motions"]

    def apply(self, shifts_px: Shifts) -> Shifts:
        """The shifts without what a motion of the camera explains."""
        return shifts_px - self.out @ np.einsum("wap,wa->p", self.along, shifts_px)

    def transpose(self, shifts_px: Shifts) -> Shifts:
        """The transposed map."""
        return shifts_px - self.along @ np.einsum("wap,wa->p", self.out, shifts_px)


def without_motion(
    motions_px: Float[np.ndarray, "windows 2 motions"], information_per_px2: Float[np.ndarray, "windows 2 2"]
) -> WithoutMotion:
    """The map for windows of this information; those of none are moved, and move no other.

    With the whitened motions W B = Q S V^T, (I + W B (W B)^T)^(-1/2) = I - Q (1 - (1 + S^2)^(-1/2)) Q^T.
    """
    values, vectors = np.linalg.eigh(information_per_px2)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.transpose(0, 2, 1)
    whitened = (root @ motions_px).reshape(-1, motions_px.shape[2])
    q, size, v = np.linalg.svd(whitened, full_matrices=False)
    share = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
    back = v.T * np.divide(
        share, size, out=np.zeros_like(size), where=size > 1e-12 * max(size.max(initial=0.0), 1.0)
    )
    return WithoutMotion(motions_px @ back, root @ q.reshape(motions_px.shape))


def likeliest_motion(
    motions_px: Float[np.ndarray, "windows 2 motions"],
    information_per_px2: Float[np.ndarray, "windows 2 2"],
    shifts_px: Shifts,
) -> Float[np.ndarray, " motions"]:
    """The motion, in standard deviations, that is likeliest if the air is still."""
    weighted = np.einsum("wab,wbp->wap", information_per_px2, motions_px)
    normal = np.einsum("wap,waq->pq", motions_px, weighted) + np.eye(motions_px.shape[2])
    return np.linalg.solve(normal, np.einsum("wap,wa->p", weighted, shifts_px))
