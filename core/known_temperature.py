"""Known temperatures of the air on the vertices of a grid: planes as values, outlets and sensors as means.

The temperature of a wall is not used: its thermal layer is thinner than a cell, so the air beside it is at another
temperature. Solvers that model the layer use it. So a plane, which lies on a wall, tells the air's temperature where
air leaves through it, and where its wall is stated to pass no heat.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import RegularGridInterpolator

from core.data_error import PLANE_ON_VERTICES_K
from core.geometry import Box, WallName, face_of
from core.known import passes_no_heat
from core.problem import PlaneData, Problem
from core.scene import Heater, Inlet, Outlet, Patch, Scene
from core.setting import SettingError

Volume = Float[np.ndarray, "nx ny nz"]
# Of what is anywhere between two ends: its standard deviation over their distance.
EVEN_STD = 12**-0.5


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
    level of the whole room. Where nothing but supplies is known, the mean over the room is taken to lie somewhere
    between them, what planes show, and the air at rest.
    """
    mask = np.zeros(grid.shape, bool)
    value, std = np.full(grid.shape, np.nan), np.full(grid.shape, np.nan)
    means, entering_k = [], []
    for plane in problem.planes:
        wall: WallName = plane.wall  # type: ignore[assignment]
        kelvin = plane_on_grid(grid, plane, plane.temperature_k)
        entering, leaving = _passing(grid, plane)
        entering_k += list(kelvin[entering])
        if passes_no_heat(problem.scene, wall):
            air = ~(entering | _heated(problem.scene, grid, wall))
            # The plane's rim lies in the thermal layers of the four neighbouring walls.
            on_wall(wall, mask)[1:-1, 1:-1] = air[1:-1, 1:-1]
            on_wall(wall, value)[...] = kelvin
            on_wall(wall, std)[...] = PLANE_ON_VERTICES_K
        elif leaving.any():
            members = on_wall(wall, _numbers(grid))[leaving]
            means.append((members, float(kelvin[leaving].mean()), PLANE_ON_VERTICES_K))
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
    if not mask.any() and not means and (ends_k := _ends_k(problem, entering_k)):
        low_k, high_k = min(ends_k), max(ends_k)
        std_k = max(EVEN_STD * (high_k - low_k), PLANE_ON_VERTICES_K)
        means = [(np.arange(mask.size), 0.5 * (low_k + high_k), std_k)]
    return KnownTemperature(mask, value, std, tuple(means))


def refuse_without_level(known: KnownTemperature) -> None:
    """Raise SettingError where nothing is known of the air: images see differences of temperature alone."""
    if not known.mask.any() and not known.means:
        raise SettingError(
            "Nothing fixes the level of the temperature: deflections see only gradients. "
            "Add an inlet, an outlet's mean temperature, a point sensor, or a plane field that air passes or whose "
            "wall passes no heat."
        )


def _ends_k(problem: Problem, entering_k: list[float]) -> list[float]:
    """What the air's mean lies between where supplies alone are known; empty without them.

    `entering_k` are the temperatures of planes where air enters by them.
    """
    supplies_k = [part.temperature_k for part in problem.scene.boundary if isinstance(part, Inlet)]
    known_k = [*supplies_k, *entering_k]
    return [*known_k, *planes_ends_k(problem), problem.scene.air.ambient_temperature_k] if known_k else []


def planes_ends_k(problem: Problem) -> list[float]:
    """The lowest and the highest temperature of each plane."""
    return [float(end(plane.temperature_k)) for plane in problem.planes for end in (np.min, np.max)]


def known_air_k(problem: Problem) -> list[float]:
    """Temperatures of air that are known somewhere: supplies, heaters, outlets, sensors."""
    kelvin = [float(t) for s in problem.sensors for t in s.temperature_k[np.isfinite(s.temperature_k)]]
    for item in problem.scene.boundary:
        match item:
            case Inlet() | Heater():
                kelvin.append(item.temperature_k)
            case Outlet(mean_temperature_k=float() as mean):
                kelvin.append(mean)
            case _:
                pass
    return kelvin


def _heated(scene: Scene, grid: VertexGrid, wall: WallName) -> Bool[np.ndarray, "first second"]:
    """Vertices on heaters of a wall."""
    masks = [
        patch_mask(grid, part.patch)
        for part in scene.boundary
        if isinstance(part, Heater) and part.patch.wall == wall
    ]
    return np.logical_or.reduce([np.zeros_like(on_wall(wall, _numbers(grid)), bool), *masks])


def _passing(
    grid: VertexGrid, plane: PlaneData
) -> tuple[Bool[np.ndarray, "first second"], Bool[np.ndarray, "first second"]]:
    """Vertices beside which air enters by a plane, and those around which it leaves everywhere."""
    face = face_of(plane.wall)  # type: ignore[arg-type]
    inward = face.inward * np.asarray(plane.velocity_m_s)[..., face.axis]
    entering, leaving = (
        plane_on_grid(grid, plane, np.where(sign * inward > 0, 1.0, 0.0)) for sign in (1, -1)
    )
    return entering > 0, leaving == 1


def _numbers(grid: VertexGrid) -> Int[np.ndarray, "nx ny nz"]:
    return np.arange(int(np.prod(grid.shape))).reshape(grid.shape)


def _patch_vertices(grid: VertexGrid, patch: Patch) -> Int[np.ndarray, " members"]:
    return on_wall(patch.wall, _numbers(grid))[patch_mask(grid, patch)]


def _nearest(grid: VertexGrid, position_m: Float[np.ndarray, "3"]) -> int:
    index = [int(np.abs(axis - p).argmin()) for axis, p in zip(grid.axes_m, position_m, strict=True)]
    return int(np.ravel_multi_index(index, grid.shape))
