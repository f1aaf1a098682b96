"""Known temperatures on the vertices of a grid: planes as values, outlets and sensors as means.

The temperature of a wall is not used: its thermal layer is thinner than a cell, so the air beside it is at another
temperature. Solvers that model the layer use it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import RegularGridInterpolator

from core.data_error import PLANE_ON_VERTICES_K
from core.geometry import Box, WallName, face_of
from core.problem import PlaneData, Problem
from core.scene import Inlet, Outlet, Patch

Volume = Float[np.ndarray, "nx ny nz"]


@dataclass(frozen=True)
class VertexGrid:
    """Evenly spaced vertices of a box, end planes included."""

    box: Box
    shape: tuple[int, int, int]

    @property
    def axes_m(self) -> tuple[Float[np.ndarray, " nx"], Float[np.ndarray, " ny"], Float[np.ndarray, " nz"]]:
        """Coordinates along x, y, z."""
        ends = zip(self.box.lower_m, self.box.upper_m, self.shape, strict=True)
        x_m, y_m, z_m = (np.linspace(low, high, n) for low, high, n in ends)
        return x_m, y_m, z_m

    @property
    def spacing_m(self) -> tuple[float, ...]:
        """Distance between vertices along x, y, z."""
        return tuple(s / (n - 1) for s, n in zip(self.box.size_m, self.shape, strict=True))


@dataclass(frozen=True)
class KnownTemperature:
    """`temperature_k` with `std_k` where `mask`; and means over sets of vertices (flat indices)."""

    mask: Bool[np.ndarray, "nx ny nz"]
    temperature_k: Volume
    std_k: Volume
    means: tuple[tuple[Int[np.ndarray, " members"], float, float], ...]


def on_wall(wall: WallName, values: np.ndarray) -> np.ndarray:
    """A writable view of the wall's plane of a volume."""
    face = face_of(wall)
    return np.moveaxis(values, face.axis, 0)[face.end]


def patch_mask(grid: VertexGrid, patch: Patch) -> Bool[np.ndarray, "first second"]:
    """Which vertices of the wall lie in the patch; the nearest one when none does."""
    masks = []
    for other, low, high in zip(face_of(patch.wall).along, patch.lower_m, patch.upper_m, strict=True):
        coordinates = grid.axes_m[other]
        tolerance = 1e-6 * (coordinates[-1] - coordinates[0])
        inside = (coordinates >= low - tolerance) & (coordinates <= high + tolerance)
        if not inside.any():
            inside[np.abs(coordinates - (low + high) / 2).argmin()] = True
        masks.append(inside)
    return masks[0][:, None] & masks[1][None]


def plane_on_grid(grid: VertexGrid, plane: PlaneData, values: np.ndarray) -> np.ndarray:
    """A plane's values at the grid's vertices on that wall (bilinear; the nearest edge outside)."""
    own = (plane.first_m, plane.second_m)
    targets = [
        np.clip(grid.axes_m[other], line[0], line[-1])
        for other, line in zip(face_of(plane.wall).along, own, strict=True)
    ]
    mesh = np.stack(np.meshgrid(*targets, indexing="ij"), axis=-1)
    return RegularGridInterpolator(own, np.asarray(values, np.float64))(mesh)


def known_temperature(problem: Problem, grid: VertexGrid) -> KnownTemperature:
    """Gather planes, outlets and sensors.

    Supply air and heaters are not the temperature of the room's air: as values at their place they would lift the
    level of the whole room. The supply's temperature is used only if nothing else is known.
    """
    mask = np.zeros(grid.shape, bool)
    value, std = np.full(grid.shape, np.nan), np.full(grid.shape, np.nan)
    for plane in problem.planes:
        wall: WallName = plane.wall  # type: ignore[assignment]
        # The plane's rim lies in the thermal layers of the four neighbouring walls.
        on_wall(wall, mask)[1:-1, 1:-1] = True
        on_wall(wall, value)[...] = plane_on_grid(grid, plane, plane.temperature_k)
        on_wall(wall, std)[...] = PLANE_ON_VERTICES_K
    means = []
    for known in problem.scene.boundary:
        if isinstance(known, Outlet) and known.mean_temperature_k is not None:
            members = _patch_vertices(grid, known.patch)
            means.append((members, known.mean_temperature_k, known.temperature_std_k))
    for sensors in problem.sensors:
        for position, kelvin, kelvin_std in zip(
            sensors.position_m, sensors.temperature_k, sensors.temperature_std_k, strict=True
        ):
            if np.isfinite(kelvin):
                means.append((np.array([_nearest(grid, position)]), float(kelvin), float(kelvin_std)))
    if not mask.any() and not means:
        # The last resort: supply air is the one temperature that is known.
        means = [
            (_patch_vertices(grid, known.patch), known.temperature_k, known.temperature_std_k)
            for known in problem.scene.boundary
            if isinstance(known, Inlet)
        ]
    return KnownTemperature(mask, value, std, tuple(means))


def _patch_vertices(grid: VertexGrid, patch: Patch) -> Int[np.ndarray, " members"]:
    everything = np.arange(int(np.prod(grid.shape))).reshape(grid.shape)
    return on_wall(patch.wall, everything)[patch_mask(grid, patch)]


def _nearest(grid: VertexGrid, position_m: Float[np.ndarray, "3"]) -> int:
    index = [int(np.abs(axis - p).argmin()) for axis, p in zip(grid.axes_m, position_m, strict=True)]
    return int(np.ravel_multi_index(index, grid.shape))
