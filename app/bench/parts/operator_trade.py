"""The straight-ray operator's row of `airlens bench rays`: windows instead of rays, its transpose as gradient."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from app.bench.parts.ray_trade import AIR, ROOM, RayRow, bend, cpu_s, grid64
from core.fields import GridField
from core.geometry import looking_along_y
from core.rays import StraightTracer
from core.rays.operator import StraightRayOperator, build
from core.render.pixel_geometry import pixel_geometry
from core.scene import FixedTexture, Scene, View

_WINDOW_PX = 27.0
_PX_PER_M = 999.0
_MIDDLE_PX = np.array([2047.5, 1535.5])


def operator_row(stand_off_m: float = 30.0) -> RayRow:
    """The straight-ray operator on 110 x 110 windows; its gradient is the transpose."""
    scene, pixels, field = _scene(stand_off_m), window_centres(), grid64(10.0)
    operator = windows_operator(stand_off_m)
    found = np.asarray(operator.apply(jnp.asarray(field.values)))
    traced = _traced_px(scene, pixels, field)
    whole = np.all(np.abs(pixels - _MIDDLE_PX) < np.array([2020.0, 1470.0]), axis=1)
    error = np.linalg.norm((found - traced)[whole]) / np.linalg.norm(traced[whole])
    apply, transpose = eqx.filter_jit(lambda o, v: o.apply(v)), eqx.filter_jit(lambda o, d: o.transpose(d))
    size = sum(leaf.nbytes for leaf in jax.tree.leaves(eqx.filter(operator, eqx.is_array)))
    return RayRow(
        field="grid64", tracer="operator", dT_K=10.0, stand_off_m=stand_off_m, steps=64, dtype="float32",
        rel_error=float(error), forward_rays_per_s=len(pixels) / cpu_s(apply, operator, field.values),
        gradient_rays_per_s=len(pixels) / cpu_s(transpose, operator, jnp.asarray(found)),
        peak_memory_mb=size / 1e6,
    )  # fmt: skip


def windows_operator(stand_off_m: float) -> StraightRayOperator:
    """The operator from 64^3 vertices to the windows' displacement."""
    return build(_scene(stand_off_m), 0, window_centres(), (64, 64, 64), window_px=_WINDOW_PX)


def window_centres() -> Float[np.ndarray, "windows 2"]:
    """110 x 110 windows over the wall, as (column, row)."""
    lines = [(np.arange(110) + 0.5) * n / 110 for n in (4096, 2990)]
    return np.stack([a.ravel() for a in np.meshgrid(*lines)], axis=1)


def _scene(stand_off_m: float) -> Scene:
    camera = looking_along_y(
        position_m=(0.85, 1.5 - stand_off_m, 1.5), width_px=4096, height_px=3072,
        focal_px=_PX_PER_M * stand_off_m,
    )  # fmt: skip
    return Scene(room=ROOM, views=(View(camera=camera),), light=FixedTexture())


def _traced_px(
    scene: Scene, pixels: Float[np.ndarray, "windows 2"], field: GridField
) -> Float[np.ndarray, "windows 2"]:
    """The same windows by traced rays: 5 x 5 a window, 512 steps."""
    places = ((np.arange(5) + 0.5) / 5 - 0.5) * _WINDOW_PX
    total = np.zeros(pixels.shape)
    tracer = StraightTracer(512, AIR.ambient_refractivity)
    for column in places:
        for row in places:
            geometry = pixel_geometry(scene, 0, pixels + np.array([column, row]))
            shift_m = np.asarray(bend(tracer, geometry.camera, field))[:, [0, 2]]
            lit = np.asarray(geometry.weight > 0)[:, None]
            total += shift_m * np.array([-_PX_PER_M, _PX_PER_M]) * lit / 25
    return total
