import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import GridField
from core.geometry import Box, looking_along_y
from core.render import render_flow, render_reference
from core.scene import FixedTexture, ProjectedPattern, Scene, View, WaveletPattern

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 1.5))
CAMERA = looking_along_y(position_m=(1.0, -2.0, 0.75), width_px=64, height_px=48, focal_px=120.0)
PROJECTOR = looking_along_y(position_m=(1.4, -2.0, 0.5), width_px=96, height_px=72, focal_px=110.0)


def scene(light) -> Scene:
    return Scene(room=ROOM, views=(View(camera=CAMERA),), light=light)


LIGHTS = [FixedTexture(pixel_m=0.02), ProjectedPattern(projector=PROJECTOR)]


@pytest.mark.parametrize("light", LIGHTS, ids=["texture", "projector"])
def test_zero_flow_gives_exactly_the_reference_and_flow_does_not(light):
    still = GridField(ROOM.lower_m, ROOM.upper_m, jnp.zeros((5, 6, 4), jnp.float32))
    values = np.random.default_rng(0).normal(0, 1e-6, (5, 6, 4)).astype(np.float32)

    reference = render_reference(scene(light))

    assert np.array_equal(render_flow(scene(light), still), reference)
    assert not np.array_equal(
        render_flow(scene(light), GridField(ROOM.lower_m, ROOM.upper_m, values)), reference
    )


def test_camera_and_projector_in_one_place_see_no_shift():
    light = ProjectedPattern(projector=CAMERA, pattern=WaveletPattern(contrast=0.2))
    values = np.random.default_rng(0).normal(0, 1e-6, (5, 6, 4)).astype(np.float32)

    difference = render_flow(scene(light), GridField(ROOM.lower_m, ROOM.upper_m, values)) - render_reference(
        scene(light)
    )

    # A shift of 1e-6 px on slopes of about 0.2 a pixel, plus one float32 step of the luminance.
    assert np.abs(difference).max() < 1e-6 * 0.5 + 1.2e-7
