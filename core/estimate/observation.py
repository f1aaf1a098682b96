"""The observation operator: measurements as one vector, and what a room would have shown in the same order.

Shifts are pooled into blocks about two cells wide, the least that a coarse grid represents. Windows beside walls
are left out: the thermal layer there is thinner than a cell. A plane of known T is pooled too. Every datum carries
its noise; the fit adds the representation error.
"""

from collections.abc import Iterator

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.interpolate import RegularGridInterpolator

from core.continuity import moved_as_air
from core.data_error import PLANE_NOISE_K, WALL_MARGIN, alike_share
from core.estimate.plane_openings import air_planes, still_vertices
from core.geometry import Box, face_of
from core.known import measured_outlets
from core.motion import without_motion
from core.problem import PlaneData, Problem, SensorData, ShiftMeasurement
from core.rays.operator import StraightRayOperator, build
from core.rays.visibility import away_from_walls
from core.room.room_grid import AXES
from core.room.vertices import RoomFields, interpolated, linear_matrix
from core.scene import Outlet, Scene
from core.view_frame import facing

_BLOCKS_ACROSS = 28
# Kinds of data in `Observations.values`; neighbours of the first two have correlated errors.
IMAGES, PLANES, SENSORS, SPEEDS, OUTLETS = range(5)


class ShiftBlocks(eqx.Module):
    """Pooled shifts of one view: `row[w]` is the block of window w, or -1 if the window is left out.

    `cell` is each block's place in the picture, counted in blocks. `shared_px` are independent errors of one standard
    deviation that blocks share, such as what the camera may have done between the exposures; there may be none.
    """

    operator: StraightRayOperator
    row: Int[np.ndarray, " windows"]
    cell: Int[np.ndarray, "blocks 2"]
    weight: Float[np.ndarray, "windows 2 2"]
    displacement_px: Float[np.ndarray, "blocks 2"]
    variance_px2: Float[np.ndarray, "blocks 2"]
    shared_px: Float[np.ndarray, "blocks 2 errors"]

    def predicted(self, excess_refractivity: Float[Array, "vx vy vz"]) -> Float[np.ndarray, "blocks 2"]:
        """The blocks' shifts for a refractivity on the operator's vertices."""
        return self.pooled(np.asarray(_apply(self.operator, excess_refractivity)))

    def pooled(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Float[np.ndarray, "blocks 2"]:
        """Information-weighted mean of the windows of each block."""
        total = np.zeros_like(self.displacement_px)
        used = self.row >= 0
        np.add.at(total, self.row[used], np.einsum("wij,wj->wi", self.weight, displacement_px)[used])
        return total


@eqx.filter_jit
def _apply(
    operator: StraightRayOperator, excess_refractivity: Float[Array, "vx vy vz"]
) -> Float[Array, "windows 2"]:
    return operator.apply(excess_refractivity)


def shift_blocks(
    scene: Scene,
    view: int,
    measured: ShiftMeasurement,
    used: Bool[np.ndarray, " windows"],
    vertices: tuple[int, int, int],
) -> ShiftBlocks | None:
    """Pool those of one view's windows that are used; None without any."""
    operator = build(scene, view, measured.centres_px, vertices, float(measured.window_px))
    block_px = _block_px(facing(scene, view)[0].room, operator, measured)
    cell = np.floor(measured.centres_px / block_px).astype(int)
    if not used.any():
        return None
    key = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    row = np.full(len(key), -1)
    _, one, row[used] = np.unique(key[used], return_index=True, return_inverse=True)
    total = np.zeros((row.max() + 1, 2, 2))
    np.add.at(total, row[used], measured.information_per_px2[used])
    covariance = np.linalg.inv(total)
    weight = np.einsum("wij,wjk->wik", covariance[np.maximum(row, 0)], measured.information_per_px2)
    blocks = ShiftBlocks(
        operator,
        row,
        cell[used][one],
        weight,
        np.zeros(total.shape[:2]),
        np.diagonal(covariance, axis1=1, axis2=2).copy(),
        np.zeros((len(total), 2, 0)),
    )
    errors_px = measured.common_errors_px
    if errors_px is not None:
        shared_px = np.stack([blocks.pooled(error) for error in np.moveaxis(errors_px, -1, 0)], axis=-1)
        blocks = eqx.tree_at(lambda b: b.shared_px, blocks, shared_px)
    return eqx.tree_at(lambda b: b.displacement_px, blocks, blocks.pooled(measured.displacement_px))


def _block_px(room: Box, operator: StraightRayOperator, measured: ShiftMeasurement) -> float:
    """Block edge in px: the room's longer side in `_BLOCKS_ACROSS`, at least one window."""
    scale = np.asarray(operator.px_per_m)
    px_per_m = float(np.median(np.abs(np.linalg.det(scale[np.abs(scale).sum((1, 2)) > 0]))) ** 0.5)
    wanted = max(room.size_m[0], room.size_m[2]) / _BLOCKS_ACROSS * px_per_m
    return max(1.0, np.round(wanted / measured.window_px)) * measured.window_px


class Observations(eqx.Module):
    """All data of a problem as one vector.

    `outlets` are those with a thermometer, each with its place among the scene's outlets. `moved` are each view's
    windows that moved as air does; the others are in none of the `shifts`.
    """

    scene: Scene = eqx.field(static=True)
    shifts: tuple[ShiftBlocks, ...]
    moved: tuple[Bool[np.ndarray, " _"], ...]
    planes: tuple[PlaneData, ...]
    sensors: tuple[SensorData, ...]
    outlets: tuple[tuple[int, Outlet, float], ...] = eqx.field(static=True)
    vertices: tuple[int, int, int] = eqx.field(static=True)

    def views(self) -> Iterator[tuple[ShiftBlocks, slice]]:
        """Each view's blocks, and where their shifts stand among the data: these begin with them."""
        start = 0
        for blocks in self.shifts:
            own = slice(start, start + blocks.displacement_px.size)
            yield blocks, own
            start = own.stop

    def values(
        self,
    ) -> tuple[Float[np.ndarray, " data"], Float[np.ndarray, " data"], Int[np.ndarray, " data"]]:
        """Data, noise variances, and kinds: shifts, planes, sensors' T and u, outlets."""
        parts = [(b.displacement_px.ravel(), b.variance_px2.ravel(), IMAGES) for b in self.shifts]
        ambient = self.scene.air.ambient_temperature_k
        parts += [
            (_plane_pool(p, p.temperature_k - ambient, self.scene), PLANE_NOISE_K**2, PLANES)
            for p in self.planes
        ]
        for s in self.sensors:
            t, u = np.isfinite(s.temperature_k), np.isfinite(s.velocity_m_s)
            std = np.broadcast_to(s.velocity_std_m_s[:, None], u.shape)
            parts.append((s.temperature_k[t] - ambient, s.temperature_std_k[t] ** 2, SENSORS))
            parts.append((s.velocity_m_s[u], std[u] ** 2, SPEEDS))
        parts += [
            (np.array([k - ambient]), outlet.temperature_std_k**2, OUTLETS) for _, outlet, k in self.outlets
        ]
        values = np.concatenate([np.asarray(v, float).ravel() for v, _, _ in parts] or [np.zeros(0)])
        variance = np.concatenate(
            [np.broadcast_to(s, np.shape(v)).ravel() for v, s, _ in parts] or [np.zeros(0)]
        )
        group = np.concatenate([np.full(np.size(v), g) for v, _, g in parts] or [np.zeros(0)]).astype(int)
        return values, variance, group

    def alike(self) -> Float[np.ndarray, " data"]:
        """How many data count as one, because they share the model's error, in the order of `values`.

        In a picture, for each component of the shift, and in a plane a fixed share of the data (`alike_share`); 1 for
        thermometers.
        """
        share = alike_share(2)
        counts = [len(blocks.displacement_px) for blocks, _ in self.views() for _ in range(2)]
        counts += self.plane_blocks()
        alike = np.concatenate([np.zeros(0), *(np.full(n, max(share * n, 1.0)) for n in counts)])
        return np.concatenate([alike, np.ones(len(self.values()[0]) - len(alike))])

    def predicted(self, room: RoomFields) -> Float[np.ndarray, " data"]:
        """What measurements would show of this room, in the order of `values`."""
        refractivity = self.scene.air.excess_refractivity(jnp.asarray(room.excess_k, jnp.float32))
        parts = [b.predicted(refractivity).ravel() for b in self.shifts]
        parts.append(self.plane_values(room.excess_k))
        for s in self.sensors:
            t, u = np.isfinite(s.temperature_k), np.isfinite(s.velocity_m_s)
            parts.append(sample(room.excess_k, s.position_m, self.scene.room)[t])
            parts.append(sample(room.velocity_m_s, s.position_m, self.scene.room)[u])
        parts += [room.outflow_excess_k[n : n + 1] for n, *_ in self.outlets]
        return np.concatenate([np.asarray(p, float).ravel() for p in parts] or [np.zeros(0)])

    def unshared(
        self, values: Float[np.ndarray, "data ..."], variance: Float[np.ndarray, " data"]
    ) -> Float[np.ndarray, "data ..."]:
        """Values without what the errors that windows share explain of them, where data have this variance beside.

        Applied to data and to predictions alike, it makes a sum of squares over `variance` one over the whole
        covariance (`core.motion`).
        """
        rest = np.array(values, float)
        for blocks, own in self.views():
            if blocks.shared_px.shape[2]:
                information = np.einsum("ba,ac->bac", 1.0 / variance[own].reshape(-1, 2), np.eye(2))
                without = without_motion(blocks.shared_px, information)
                out, along = (
                    of.reshape(blocks.displacement_px.size, -1) for of in (without.out, without.along)
                )
                rest[own] -= out @ (along.T @ rest[own])
        return rest

    def plane_values(self, excess_k: Float[np.ndarray, "vx vy vz"]) -> Float[np.ndarray, " blocks"]:
        """A room's temperature on the planes, pooled into their blocks."""
        return np.concatenate([np.zeros(0), *self._plane_parts(excess_k)])

    def plane_blocks(self) -> list[int]:
        """The number of blocks of each plane."""
        return [len(part) for part in self._plane_parts(np.zeros((2, 2, 2)))]

    def _plane_parts(self, excess_k: Float[np.ndarray, "vx vy vz"]) -> list[Float[np.ndarray, " blocks"]]:
        parts = []
        for plane in self.planes:
            face = face_of(plane.wall)
            wall = np.take(excess_k, face.end, axis=face.axis)
            parts.append(_plane_pool(plane, _on_plane(wall, plane, self.scene.room), self.scene))
        return parts


def observations(problem: Problem, vertices: tuple[int, int, int]) -> Observations:
    """A problem's measurements, to be compared with rooms on `vertices`."""
    scene = problem.scene
    away = [away_from_walls(scene, n, of.centres_px, WALL_MARGIN) for n, of in enumerate(problem.shifts)]
    moved = tuple(moved_as_air(*of) for of in zip(problem.shifts, away, strict=True))
    blocks = [shift_blocks(scene, n, of, away[n] & moved[n], vertices) for n, of in enumerate(problem.shifts)]
    return Observations(
        scene,
        tuple(b for b in blocks if b is not None),
        moved,
        tuple(air_planes(problem)),
        problem.sensors,
        tuple(measured_outlets(scene)),
        vertices,
    )


def sample(
    field: Float[np.ndarray, "vx vy vz ..."], points_m: Float[np.ndarray, "points 3"], room: Box
) -> Float[np.ndarray, "points ..."]:
    """Trilinear interpolation of a vertex field; a point outside the room gets the value on the wall."""
    axes = [np.linspace(room.lower_m[a], room.upper_m[a], field.shape[a]) for a in AXES]
    clipped = np.clip(points_m, room.lower_m, room.upper_m)
    return RegularGridInterpolator(axes, np.asarray(field, float))(clipped)


def _on_plane(
    wall: Float[np.ndarray, "first second"], plane: PlaneData, room: Box
) -> Float[np.ndarray, "rows cols"]:
    """A wall's vertex values, interpolated to the plane's vertices."""
    first, second = face_of(plane.wall).along
    for axis, points, at in ((first, plane.first_m, 0), (second, plane.second_m, 1)):
        nodes = np.linspace(room.lower_m[axis], room.upper_m[axis], wall.shape[at])
        wall = interpolated(linear_matrix(nodes, points), wall, at)
    return wall


def _plane_pool(
    plane: PlaneData, values: Float[np.ndarray, "rows cols"], scene: Scene
) -> Float[np.ndarray, " blocks"]:
    """Means over 6 x 12 blocks of the plane without its openings."""
    still = still_vertices(plane)
    rows, cols = (
        np.minimum((np.arange(n) * m) // n, m - 1) for n, m in zip(values.shape, (6, 12), strict=True)
    )
    key = rows[:, None] * 12 + cols[None, :]
    count = np.bincount(key[still], minlength=72)
    total = np.bincount(key[still], weights=values[still], minlength=72)
    return total[count > 0] / count[count > 0]
