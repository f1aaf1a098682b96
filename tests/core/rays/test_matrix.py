from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.rays.matrix import as_matrix
from core.rays.operator import build
from core.scene import FixedTexture, ProjectedPattern, Scene, View
from tests.core.rays.test_operator import CAMERA, PROJECTOR, ROOM, SHAPE, TILTED, window_centres
from tests.core.test_view_frame import AHEAD, LIT, PIXELS, elsewhere

BESIDE = replace(PROJECTOR, position_m=(4.0, -1.0, 0.7))


def scene_of(camera=CAMERA, light=FixedTexture()) -> Scene:
    return Scene(room=ROOM, views=(View(camera=camera),), light=light)


@pytest.mark.parametrize(
    "scene",
    [
        scene_of(),
        scene_of(TILTED, ProjectedPattern(projector=PROJECTOR)),
        scene_of(light=ProjectedPattern(projector=BESIDE)),
        elsewhere(AHEAD, "x_min"),
        elsewhere(LIT, "z_max"),
    ],
    ids=["lattice", "taps of a lattice", "gathered", "another wall", "another wall, lit"],
)
def test_the_matrix_is_the_operator(scene):
    pixels = window_centres() if scene.room == ROOM else PIXELS
    operator = build(scene, 0, pixels, SHAPE, window_px=4.0)
    values = np.random.default_rng(0).standard_normal(SHAPE).astype(np.float32)

    found = as_matrix(operator) @ values.ravel().astype(float)

    # The operator's own sums are in float32.
    expected = np.asarray(operator.apply(jnp.asarray(values)), float)
    np.testing.assert_allclose(found.reshape(-1, 2), expected, atol=3e-6 * np.abs(expected).max())
