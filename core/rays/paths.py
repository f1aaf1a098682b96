"""Straight paths to points of the back wall through a vertex grid: what the linear maps share.

With y along the view, slopes p = d_x / d_y and q = d_z / d_y, Y the back wall and y0 the entry, the
first-order wall shift of m = (N - N0) / (1 + N0), slid along the ray onto the wall, is

    shift_x = (1 + p^2 + q^2) [ (1 + p^2) Gx + p q Gz - p E ]        shift_z likewise,
    Gx = int (Y - y) dm/dx dy,   Gz = int (Y - y) dm/dz dy,   E = int m dy - (Y - y0) m(y0)

(the y-derivative of m is integrated by parts). m is linear in y between the grid's y-planes and
bilinear on them, as in `GridField`.
"""

from abc import abstractmethod

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from core.geometry import Box


class AbstractWallPaths(eqx.Module):
    """A linear map from m on the vertices to the wall shift of each path."""

    @abstractmethod
    def shift_m(self, excess: Float[Array, "nx ny nz"]) -> Float[Array, "rays 2"]:
        """Wall shift along x and z of each path [m], for a field m on the vertices."""

    @abstractmethod
    def chosen(self, rows: Int[Array, " some"]) -> "AbstractWallPaths":
        """The same map for some of the paths."""


class Fan(eqx.Module):
    """Straight paths from one origin to points of the back wall, float64."""

    origin_m: Float[np.ndarray, "3"]
    points_m: Float[np.ndarray, "rays 3"]

    @property
    def slopes(self) -> Float[np.ndarray, "rays 2"]:
        """p and q of each path."""
        across = (self.points_m - self.origin_m)[:, [0, 2]]
        return across / (self.points_m[:, 1:2] - self.origin_m[1])

    def entry_y_m(self, room: Box) -> Float[np.ndarray, " rays"]:
        """Where each path enters the room: through the front, a side, or at an origin inside."""
        front = max(room.lower_m[1], float(self.origin_m[1]))
        entry = np.full(len(self.points_m), front)
        for axis, slope in zip((0, 2), self.slopes.T, strict=True):
            face = np.where(slope > 0, room.lower_m[axis], room.upper_m[axis])
            with np.errstate(divide="ignore", invalid="ignore"):
                crossing = self.origin_m[1] + (face - self.origin_m[axis]) / slope
            # An origin between two faces crosses them behind itself; a path along a face never does.
            entry = np.fmax(entry, np.where(np.isfinite(crossing), crossing, -np.inf))
        return np.minimum(entry, room.upper_m[1])


def plane_moments(
    room: Box, planes: int, entry_y_m: Float[np.ndarray, " rays"]
) -> tuple[Float[np.ndarray, "rays planes"], Float[np.ndarray, "rays planes"]]:
    """Weights of the y-planes: int (Y - y) hat_j dy, and int hat_j dy - (Y - y0) hat_j(y0)."""
    upper = room.upper_m[1]
    y_m = np.linspace(room.lower_m[1], upper, planes)
    spacing = y_m[1] - y_m[0]
    low = np.clip(entry_y_m[:, None], y_m[:-1], y_m[1:])
    width = y_m[1:] - low
    lever, plain = (np.zeros((len(entry_y_m), planes)) for _ in range(2))
    # Two Gauss points a slab are exact for a product of two linear functions.
    for node in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
        place = low + node * width
        share = (place - y_m[:-1]) / spacing
        for side, hat in ((slice(0, -1), 1 - share), (slice(1, None), share)):
            lever[:, side] += 0.5 * width * hat * (upper - place)
            plain[:, side] += 0.5 * width * hat
    at_entry = np.clip(1 - np.abs(entry_y_m[:, None] - y_m) / spacing, 0.0, 1.0)
    return lever, plain - (upper - entry_y_m)[:, None] * at_entry
