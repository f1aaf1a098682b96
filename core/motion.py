"""What the camera may have done between the exposures: a small motion of the whole picture that nobody knows.

A mount creeps, a lens breathes. The picture then moves by a shift, a rotation and a magnification, which hide a part
of what the air does (a linear profile of temperature moves the whole picture by one vector). The shifts d of the
windows therefore have the covariance

    C = information^-1 + B B^T,     B: the motions of one standard deviation, at the windows.

`WithoutMotion` is the exact way to use C in a solver that knows windows with errors of their own: applied to what was
measured and to what a model predicts alike, it makes the weighted sum of squares of their difference r^T C^-1 r. The
motion is then neither fitted nor assumed; it is marginalised.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

Shifts = Float[np.ndarray, "windows 2"]


def similarity_basis(
    points_px: Float[np.ndarray, "points 2"], shape: tuple[int, int]
) -> Float[np.ndarray, "points 2 4"]:
    """Displacement by a unit of (column, row, rotation, dilation), about the centre of a picture of rows, columns."""
    x, y = (points_px - (np.array(shape[::-1]) - 1) / 2).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([one, zero, -y, x], -1), np.stack([zero, one, x, y], -1)], axis=-2)


def edge_basis(
    points_px: Float[np.ndarray, "points 2"], size_px: tuple[int, int]
) -> Float[np.ndarray, "points 2 4"]:
    """`similarity_basis` with rotation and magnification in px at the edge of a picture of columns, rows."""
    half = max(size_px) / 2
    return similarity_basis(points_px, (size_px[1], size_px[0])) / np.array([1.0, 1.0, half, half])


class CameraMotion(eqx.Module):
    """The unknown motion of one view's picture.

    The columns of `root_px` are independent motions of one standard deviation, each as its shift along columns and
    rows, rotation and magnification [px at the picture's edge]. The motion's covariance is root_px root_px^T.
    """

    size_px: tuple[int, int] = eqx.field(static=True)
    root_px: Float[np.ndarray, "4 4"]

    def at(self, points_px: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2 4"]:
        """What each motion of one standard deviation does at points (column, row)."""
        return edge_basis(points_px, self.size_px) @ self.root_px


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
    motions_px: Float[np.ndarray, "windows 2 4"],
    information_per_px2: Float[np.ndarray, "windows 2 2"],
    shifts_px: Shifts,
) -> Float[np.ndarray, " 4"]:
    """The motion, in standard deviations, that is likeliest if the air is still."""
    weighted = np.einsum("wab,wbp->wap", information_per_px2, motions_px)
    normal = np.einsum("wap,waq->pq", motions_px, weighted) + np.eye(motions_px.shape[2])
    return np.linalg.solve(normal, np.einsum("wap,wa->p", weighted, shifts_px))
