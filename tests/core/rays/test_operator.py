from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import GridField
from core.geometry import Box, looking_along_y
from core.rays.gathered import GatheredPaths
from core.rays.operator import build
from core.rays.optics import pinhole
from core.rays.straight import StraightTracer
from core.render.pixel_geometry import pixel_geometry
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


def traced_px(scene: Scene, pixels: np.ndarray) -> np.ndarray:
    """Displacement by rays traced in fine steps through the trilinear field."""
    geometry = pixel_geometry(scene, 0, pixels)
    field = GridField(ROOM.lower_m, ROOM.upper_m, plume())
    offset_m = wall_offset_m(geometry, field, StraightTracer(200, scene.air.ambient_refractivity))
    # d pixel / d wall from finite differences: independent of the operator's own Jacobian.
    lens = pinhole(scene.views[0].camera)
    direction = np.asarray(geometry.camera.direction)
    wall_m = scene.views[0].camera.position_m + direction * (4.0 / direction[:, 1:2])
    moved = [jax.vmap(lens.project)(jnp.asarray(wall_m + h * np.asarray(offset_m))) for h in (-500.0, 500.0)]
    return np.asarray(moved[0] - moved[1]) / 1000 * np.asarray(geometry.weight > 0)[:, None]


def inside(scene: Scene, pixels: np.ndarray, half_px: float) -> np.ndarray:
    """Whether a window lies on the lit wall with all its corners."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * half_px
    every = (pixels[:, None] + corners).reshape(-1, 2)
    return (np.asarray(pixel_geometry(scene, 0, every).weight) > 0).reshape(-1, 4).all(1)


def averaged_px(scene: Scene, pixels: np.ndarray, window_px: float) -> np.ndarray:
    """The same, averaged over square windows."""
    places = (np.arange(6) + 0.5) / 6 - 0.5
    offsets = np.stack(np.meshgrid(places, places), -1).reshape(-1, 2) * window_px
    every = (pixels[:, None] + offsets).reshape(-1, 2)
    return traced_px(scene, every).reshape(len(pixels), -1, 2).mean(1)


def test_a_choice_of_pixels_gives_their_rows():
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=ProjectedPattern(projector=PROJECTOR))
    operator = build(scene, 0, window_centres(), SHAPE)
    rows = jnp.asarray([5, 40, 5])

    assert np.array_equal(
        operator.chosen(rows).apply(jnp.asarray(plume())), operator.apply(jnp.asarray(plume()))[rows]
    )


TILTED = replace(
    CAMERA, rotation_rad=(1.52, 0.03, 0.02), distortion=(-0.1, 0.02, 1e-3, -1e-3, 0.0)
)  # a real camera: neither level nor free of distortion


@pytest.mark.parametrize(
    ("camera", "light", "tolerance"),
    [
        (CAMERA, FixedTexture(), 0.005),
        (CAMERA, ProjectedPattern(projector=PROJECTOR), 0.01),
        (TILTED, ProjectedPattern(projector=PROJECTOR), 0.03),
    ],
    ids=["texture", "projector", "tilted-distorted"],
)
def test_operator_agrees_with_rays_traced_in_fine_steps(camera, light, tolerance):
    scene = Scene(room=ROOM, views=(View(camera=camera),), light=light)
    pixels = window_centres()

    fast = np.asarray(build(scene, 0, pixels, SHAPE, window_px=4.0).apply(jnp.asarray(plume())))

    traced = averaged_px(scene, pixels, 4.0)
    whole = inside(scene, pixels, 2.0)
    fast, traced = fast[whole], traced[whole]
    # What is left is the place of the slope within a slab of a coarse grid (24 planes), and the lattice.
    assert np.linalg.norm(fast - traced) < tolerance * np.linalg.norm(traced)


def test_paths_through_the_side_of_the_room_are_gathered_and_agree():
    # Beside the room: its light enters through the face x = 2 m.
    beside = replace(PROJECTOR, position_m=(4.0, -1.0, 0.7), rotation_rad=PROJECTOR.rotation_rad)
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=ProjectedPattern(projector=beside))
    pixels = window_centres() + 0.137

    operator = build(scene, 0, pixels, SHAPE)

    assert isinstance(operator.lit, GatheredPaths)
    traced = traced_px(scene, pixels)
    assert np.linalg.norm(operator.apply(jnp.asarray(plume())) - traced) < 0.1 * np.linalg.norm(traced)


def test_a_uniform_excess_is_invisible():
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=ProjectedPattern(projector=PROJECTOR))
    operator = build(scene, 0, window_centres(), SHAPE)

    # One kelvin everywhere; float32 sums of 1e3 terms of 1e-6 at 30 px per metre.
    assert np.abs(operator.apply(jnp.full(SHAPE, -1e-6, jnp.float32))).max() < 1e-9


def test_transpose_is_the_adjoint_of_apply():
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=ProjectedPattern(projector=PROJECTOR))
    operator = build(scene, 0, window_centres(), SHAPE)
    left = jax.random.normal(jax.random.key(0), SHAPE)
    right = jax.random.normal(jax.random.key(1), (63, 2))

    forward = float(jnp.vdot(operator.apply(left), right))

    # Float32 sums of some thousand terms with cancellation.
    assert float(jnp.vdot(left, operator.transpose(right))) == pytest.approx(forward, rel=1e-3)
