"""What a camera would see of the expected flow from other places: one flow, one map of straight rays a place.

The camera keeps its height and its lens, and is turned so that the middle of its picture stays where it is on the
wall. A place costs some hundredths of a second after the first: its pixels are those that see the same points of
the wall, so that one compiled program serves all. The noise of a window is that at the same distance from the wall,
straight behind the camera's present place. Error: the picture's signal
to noise is within a sixth of that of a plan made there.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.displacement import resolve_window_px
from core.geometry import Optics, Vector3, rotation_matrix, rotation_vector
from core.plan.expected import ExpectedFlow
from core.plan.shift_noise import ShiftNoise, shift_noise
from core.rays.operator import build
from core.rays.optics import pinhole
from core.rays.visibility import sees_wall
from core.scene import Scene

_COLUMNS, _ROWS = 7, 7
_WALL_POINTS = 33
# A place is so much of the room's width away from its side walls, and of its depth from the front.
_CLEAR = 0.08
# Nearest place, in the room's depths; the farthest of a camera outside, in its present distances.
_NEAR, _FAR = 0.5, 1.25

Grid = Float[np.ndarray, "ys xs"]


@dataclass(frozen=True)
class PlaceMap:
    """Signal to noise of a window (99th percentile) and of the picture, and the share of the wall that is seen.

    NaN where an object stands, or where no window sees the wall.
    """

    x_m: Float[np.ndarray, " xs"]
    y_m: Float[np.ndarray, " ys"]
    snr: Grid
    picture_snr: Grid
    wall_share: Grid


def place_map(scene: Scene, view: int, flow: ExpectedFlow) -> PlaceMap:
    """Places over the floor for one view, at the camera's height."""
    x_m, y_m = _places_m(scene, view)
    excess = flow.excess_refractivity(scene.air)
    found = np.full((len(y_m), len(x_m), 3), np.nan)
    at_m = scene.views[view].camera.position_m
    for row, y in enumerate(y_m):
        behind = moved(scene, view, (at_m[0], float(y), at_m[2]))
        noise = shift_noise(behind, view, resolve_window_px(behind, behind.views[view]))
        for column, x in enumerate(x_m):
            there = (float(x), float(y), at_m[2])
            if np.isfinite(noise.mean_px) and not _occupied(scene, there):
                found[row, column] = seen_from(moved(scene, view, there), view, flow, excess, noise)
    return PlaceMap(x_m, y_m, *np.moveaxis(found, -1, 0))


def seen_from(
    scene: Scene, view: int, flow: ExpectedFlow, excess: Float[Array, "nx ny nz"], noise: ShiftNoise
) -> tuple[float, float, float]:
    """Signal to noise of a window and of the picture, and the share of the wall, at the camera's place."""
    camera, room = scene.views[view].camera, scene.room
    x_m, z_m = (
        room.lower_m[axis] + room.size_m[axis] * (np.arange(_WALL_POINTS) + 0.5) / _WALL_POINTS
        for axis in (0, 2)
    )
    points = np.stack(np.meshgrid(x_m, [room.upper_m[1]], z_m, indexing="ij"), axis=-1).reshape(-1, 3)
    with jax.enable_x64(True):
        lens = pinhole(camera)
        before = np.asarray(jax.vmap(lens.depth_m)(jnp.asarray(points))) > 0
        pixels = np.asarray(jax.vmap(lens.project)(jnp.asarray(points)))
    pixels = np.where(before[:, None], pixels, camera.principal_px)
    half = noise.window_px / 2
    inside = np.all(
        (pixels >= half) & (pixels <= np.array([camera.width_px, camera.height_px]) - half), axis=1
    )
    visible = before & inside & sees_wall(scene, view, pixels, margin_px=float(noise.window_px))
    if not visible.any():
        return np.nan, np.nan, 0.0
    operator = build(scene, view, pixels, flow.grid.shape, float(noise.window_px))
    shift_px = np.asarray(operator.apply(excess), np.float64)[visible]
    spread = np.abs(np.linalg.det(np.asarray(operator.px_per_m, np.float64)))[visible]
    windows = spread * room.size_m[0] * room.size_m[2] / len(points) / noise.window_px**2
    whitened = np.sum((shift_px / np.array(noise.std_px)) ** 2, axis=1)
    largest_px = np.percentile(np.linalg.norm(shift_px, axis=1), 99)
    return (
        float(largest_px / noise.mean_px),
        float(np.sqrt(np.sum(windows * whitened))),
        float(visible.mean()),
    )


def moved(scene: Scene, view: int, to_m: Vector3) -> Scene:
    """The scene with the camera of a view at another place, its picture's middle where it was on the wall."""
    camera = turned(scene.views[view].camera, scene.room.upper_m[1], to_m)
    views = tuple(replace(eye, camera=camera) if n == view else eye for n, eye in enumerate(scene.views))
    return replace(scene, views=views)


def turned(camera: Optics, wall_y_m: float, to_m: Vector3) -> Optics:
    """The camera at another place, turned by the smallest angle that keeps its picture's middle on the wall."""
    with jax.enable_x64(True):
        middle = jnp.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2])
        before = np.asarray(pinhole(camera).direction(middle))
    placed = replace(camera, position_m=to_m)
    if before[1] <= 0:
        return placed
    aim_m = np.array(camera.position_m) + (wall_y_m - camera.position_m[1]) / before[1] * before
    after = (aim_m - to_m) / np.linalg.norm(aim_m - to_m)
    axis = np.cross(before, after)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return placed
    angle = np.arctan2(sine, before @ after)
    a, b, c = (float(part) for part in axis / sine * angle)
    return replace(placed, rotation_rad=rotation_vector(camera.rotation @ rotation_matrix((a, b, c)).T))


def _places_m(scene: Scene, view: int) -> tuple[np.ndarray, np.ndarray]:
    """Places from side to side, and from near the wall backwards: to the front of the room, or behind the camera."""
    room = scene.room
    width_m, depth_m, _ = room.size_m
    x_m = room.lower_m[0] + width_m * np.linspace(_CLEAR, 1 - _CLEAR, _COLUMNS)
    wall_m, at_m = room.upper_m[1], scene.views[view].camera.position_m[1]
    far_m = (1 - _CLEAR) * depth_m if at_m >= room.lower_m[1] else _FAR * (wall_m - at_m)
    return x_m, wall_m - np.linspace(_NEAR * depth_m, far_m, _ROWS)


def _occupied(scene: Scene, place_m: Vector3) -> bool:
    return any(
        all(low <= at <= high for low, at, high in zip(one.lower_m, place_m, one.upper_m, strict=True))
        for one in scene.objects
    )
