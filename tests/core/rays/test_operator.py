import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import GridField
from core.geometry import Box, looking_along_y
from core.rays.operator import build
from core.rays.straight import StraightTracer
from core.render.geometry import pixel_geometry
from core.render.shift import wall_offset_m
from core.scene import FixedTexture, ProjectedPattern, Scene, View

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 1.5))
FOCAL_PX = 120.0
CAMERA = looking_along_y(position_m=(1.0, -2.0, 0.75), width_px=64, height_px=48, focal_px=FOCAL_PX)
PROJECTOR = looking_along_y(position_m=(1.6, -2.0, 0.5), width_px=96, height_px=72, focal_px=100.0)
SHAPE = (21, 24, 17)


def plume() -> np.ndarray:
    x, y, z = np.meshgrid(
        *(np.linspace(0, u, n) for u, n in zip(ROOM.upper_m, SHAPE, strict=True)), indexing="ij"
    )
    return (-1e-5 * np.exp(-((x - 0.9) ** 2 + (y - 1.1) ** 2 + (z - 0.8) ** 2) / 0.18)).astype(np.float32)


def window_centres() -> np.ndarray:
    columns, rows = np.meshgrid(np.linspace(4, 59, 9), np.linspace(4, 43, 7))
    return np.stack([columns.ravel(), rows.ravel()], axis=1)


@pytest.mark.parametrize(
    ("light", "tolerance"),
    [(FixedTexture(), 0.01), (ProjectedPattern(projector=PROJECTOR), 0.04)],
    ids=["texture", "projector"],
)
def test_operator_agrees_with_rays_traced_in_fine_steps(light, tolerance):
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=light)
    pixels = window_centres()

    fast = np.asarray(build(scene, 0, pixels, SHAPE).apply(jnp.asarray(plume())))

    geometry = pixel_geometry(scene, 0, pixels)
    field = GridField(ROOM.lower_m, ROOM.upper_m, plume())
    offset_m = wall_offset_m(geometry, field, StraightTracer(400, scene.air.ambient_refractivity))
    # The pattern moves against the wall shift: x to the right, z up, the wall 4 m from the camera.
    traced = np.asarray(offset_m)[:, [0, 2]] * np.array([-1.0, 1.0]) * FOCAL_PX / 4.0
    traced *= np.asarray(geometry.weight > 0)[:, None]
    assert np.linalg.norm(fast - traced) < tolerance * np.linalg.norm(traced)


def test_transpose_is_the_adjoint_of_apply():
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=ProjectedPattern(projector=PROJECTOR))
    operator = build(scene, 0, window_centres(), SHAPE)
    left = jax.random.normal(jax.random.key(0), SHAPE)
    right = jax.random.normal(jax.random.key(1), (63, 2))

    forward = float(jnp.vdot(operator.apply(left), right))

    # Float32 sums of some thousand terms with cancellation.
    assert float(jnp.vdot(left, operator.transpose(right))) == pytest.approx(forward, rel=1e-3)
