"""A reconstruction problem out of a room volume: what a rig would have measured, without taking pictures.

The shifts are traced through the volume resampled twice as fine, by another operator than the
reconstruction's (bent rays traced in many steps through a smooth interpolation, nine rays a window, not a
matrix on the unknowns' vertices). The noise is that of the rig: each window's information matrix from
the rendered reference image and the camera's noise, one random draw a window.
"""

from dataclasses import replace
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from app.reconstruct.problem import Known, problem_of
from app.volume.file import RoomVolume
from app.volume.scene import Information, RigOptions, room_scene
from core.fields import AbstractField, GridField
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.rays import NonlinearTracer
from core.rays.visibility import sees_wall
from core.render import PixelGeometry, pixel_geometry, render_reference
from core.render.shift import wall_offset_m
from core.scene import PlaneField, Scene
from core.view_frame import facing, field_facing, turn_of
from core.window_fit import derivative_filter

TRACED_STEPS = 160
_RAYS_A_WINDOW = 3
_FINER = 2


def synthetic_problem(
    volume: RoomVolume, options: RigOptions, information: Information, *, window_px: int, seed: int
) -> Problem:
    """What each view of this rig measures of this room, and what an operator with this information knows."""
    scene = room_scene(volume, options, information)
    field = fine_field(volume, scene)
    shifts = tuple(
        _measure(*facing(scene, n), field_facing(field, turn_of(scene, n)), window_px, [seed, n])
        for n in range(len(scene.views))
    )
    return problem_of(known_of_volume(volume, scene), shifts)


def known_of_volume(volume: RoomVolume, scene: Scene) -> Known:
    """What an operator who states this scene knows of the room besides its pictures."""
    return Known(scene, known_planes(volume, scene))


def known_planes(volume: RoomVolume, scene: Scene) -> tuple[PlaneData, ...]:
    """T, p, u on x_min, where the scene knows that plane."""
    return tuple(
        PlaneData(
            "x_min",
            volume.y_m,
            volume.z_m,
            np.asarray(volume.temperature_k[0], np.float64),
            np.asarray(volume.pressure_m2_s2[0], np.float64),
            np.asarray(volume.velocity_m_s[0], np.float64),
        )
        for item in scene.boundary
        if isinstance(item, PlaneField)
    )


def fine_field(volume: RoomVolume, scene: Scene) -> GridField:
    """The volume's excess refractivity, resampled by cubic splines on a finer vertex grid."""
    excess_k = np.asarray(volume.temperature_k, np.float64) - volume.ambient_k
    shape = [_FINER * (n - 1) + 1 for n in excess_k.shape]
    places = np.meshgrid(
        *(np.linspace(0, n - 1, m) for n, m in zip(excess_k.shape, shape, strict=True)), indexing="ij"
    )
    fine_k = ndimage.map_coordinates(excess_k, places, order=3, mode="nearest")
    excess = np.asarray(scene.air.excess_refractivity(jnp.asarray(fine_k, jnp.float32)))
    return GridField(scene.room.lower_m, scene.room.upper_m, jnp.asarray(excess, jnp.float32))


def tracer_of(scene: Scene) -> NonlinearTracer:
    """How the truth is traced."""
    return NonlinearTracer(TRACED_STEPS, scene.air.ambient_refractivity)


def _measure(
    scene: Scene, view: int, field: AbstractField, window_px: int, seed: list[int]
) -> ShiftMeasurement:
    """What a view measures; scene and field are in the view's own frame."""
    centres = _centres(scene, view, window_px)
    exact_px = _traced(scene, view, field, centres, window_px)
    information = _information(scene, view, window_px)
    noise = np.random.default_rng(seed).standard_normal(exact_px.shape)
    # information = L Lᵀ, so L⁻ᵀ times white noise has its inverse as covariance.
    root = np.linalg.cholesky(information)
    drawn = np.linalg.solve(root.transpose(0, 2, 1), noise[..., None])[..., 0]
    # As in a measurement: windows that do not see the patterned wall whole say nothing.
    seen = sees_wall(scene, view, centres, margin_px=float(window_px))
    return ShiftMeasurement(centres[seen], (exact_px + drawn)[seen], information[seen], window_px)


def _centres(scene: Scene, view: int, window_px: int) -> Float[np.ndarray, "windows 2"]:
    camera = scene.views[view].camera
    columns, rows = (
        (np.arange(n // window_px) + 0.5) * window_px - 0.5 for n in (camera.width_px, camera.height_px)
    )
    row, column = np.meshgrid(rows, columns, indexing="ij")
    return np.stack([column.ravel(), row.ravel()], axis=1)


def _traced(
    scene: Scene, view: int, field: AbstractField, centres: Float[np.ndarray, "windows 2"], window_px: int
) -> Float[np.ndarray, "windows 2"]:
    """Mean displacement [px] of a window's rays: minus the wall offset, seen by the camera."""
    steps = (np.arange(_RAYS_A_WINDOW) - (_RAYS_A_WINDOW - 1) / 2) * window_px / _RAYS_A_WINDOW
    tracer = tracer_of(scene)
    total = np.zeros_like(centres)
    for down in steps:
        for right in steps:
            geometry = pixel_geometry(scene, view, centres + np.array([right, down]))
            total += np.asarray(_seen_px(geometry, field, tracer), np.float64)
    return total / _RAYS_A_WINDOW**2


@eqx.filter_jit
def _seen_px(geometry: PixelGeometry, field: AbstractField, tracer: NonlinearTracer):
    offset_m = wall_offset_m(geometry, field, tracer)
    pattern_px = jnp.einsum("rij,rj->ri", geometry.pattern_from_wall, offset_m)
    inverse = jax.vmap(jnp.linalg.inv)(_safe(geometry.pattern_from_pixel))
    return -jnp.einsum("rij,rj->ri", inverse, pattern_px)


def _safe(matrix):
    """Unlit rays have a zero matrix and a zero offset: any inverse will do."""
    dark = jnp.abs(matrix).sum((1, 2)) == 0
    return jnp.where(dark[:, None, None], jnp.eye(2, dtype=matrix.dtype)[None], matrix)


def _information(scene: Scene, view: int, window_px: int) -> Float[np.ndarray, "windows 2 2"]:
    """Sums of the reference's gradients over the variance of a difference of two mean images."""
    # What is known at the boundary does not change the picture.
    reference = _reference(replace(scene, boundary=()), view)
    noise, frames = scene.views[view].noise, scene.views[view].frames
    taps = derivative_filter()
    slopes = [ndimage.correlate1d(reference, taps, axis=axis, mode="nearest") for axis in (1, 0)]
    variance_e = noise.full_well_e * reference + noise.read_noise_e**2
    variance = 2 * variance_e / noise.full_well_e**2 / frames
    rows, cols = (n // window_px for n in reference.shape)

    def summed(values: np.ndarray) -> np.ndarray:
        cut = values[: rows * window_px, : cols * window_px]
        return cut.reshape(rows, window_px, cols, window_px).sum((1, 3)).ravel()

    gx, gy = slopes
    xx, xy, yy = (summed(p / variance) for p in (gx * gx, gx * gy, gy * gy))
    matrix = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], axis=1).astype(np.float64)
    return matrix + 1e-6 * np.eye(2)


@lru_cache(maxsize=2)
def _reference(scene: Scene, view: int) -> np.ndarray:
    return np.clip(render_reference(scene, view), 1e-3, None)
