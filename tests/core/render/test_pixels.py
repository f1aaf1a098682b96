from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.fields import GridField
from core.render import pixel_renderer, render_flow, render_reference
from core.render.pixel_filter import monte_carlo, quadrature
from core.render.render_choice import choose
from core.scene import FixedTexture, ProjectedPattern, RayModel, View
from core.setting import SettingError
from tests.core.render.test_image import CAMERA, PROJECTOR, ROOM, scene

flow_of = eqx.filter_jit(lambda renderer, field: renderer.flow(field))


def warm() -> GridField:
    x, y, z = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 2, 8), np.linspace(0, 1.5, 7), indexing="ij")
    blob = np.exp(-((x - 0.9) ** 2 + (y - 1) ** 2 + (z - 0.8) ** 2) / 0.2)
    return GridField(ROOM.lower_m, ROOM.upper_m, jnp.asarray(-2e-5 * blob, jnp.float32))


def some_pixels() -> np.ndarray:
    column, row = np.meshgrid(np.arange(8, 56, 4), np.arange(8, 40, 4))
    return np.stack([column.ravel(), row.ravel()], axis=1).astype(float)


def test_quadrature_integrates_the_triangle_filter():
    for samples, degree in ((1, 1), (4, 3), (9, 5)):
        offsets, weights = quadrature(samples)
        # int s^k (1 - |s|) ds over -1 ... 1 is 2 / ((k + 1) (k + 2)) for even k.
        for k in range(degree + 1):
            exact = 2 / ((k + 1) * (k + 2)) if k % 2 == 0 else 0.0
            assert weights @ offsets[:, 0] ** k == pytest.approx(exact, abs=1e-12)


def test_random_samples_follow_the_filter_and_their_pixel():
    numbers = jnp.arange(500)

    offsets = np.asarray(monte_carlo(3, numbers, 16))

    # Variance 1/6 an axis; 8000 draws scatter by 1.5 %.
    assert offsets.reshape(-1, 2).var(0) == pytest.approx([1 / 6, 1 / 6], rel=0.06)
    assert np.array_equal(offsets[:, 7], np.asarray(monte_carlo(3, numbers[7:8], 16))[:, 0])


def test_common_random_numbers_keep_the_signal_that_independent_samples_bury():
    world = scene(ProjectedPattern(projector=PROJECTOR))
    pixels, field = some_pixels(), warm()

    exact = pixel_renderer(world, 0, pixels, field)
    first, second = (pixel_renderer(world, 0, pixels, field, monte_carlo_seed=s) for s in (1, 2))

    signal = np.linalg.norm(flow_of(exact, field) - exact.reference())
    common = np.linalg.norm(flow_of(first, field) - first.reference())
    independent = np.linalg.norm(flow_of(first, field) - second.reference())
    assert common == pytest.approx(signal, rel=0.5)
    assert independent > 20 * signal


def test_an_image_agrees_with_its_pixels_traced_one_by_one():
    # 48 x 48 pixels on cells of 0.2 m: neighbours share rays in the image, not in the renderer.
    world = replace(scene(FixedTexture(pixel_m=0.1)), rays=RayModel(steps=64))
    field = GridField(ROOM.lower_m, ROOM.upper_m, warm().values[::4, ::3, ::3])
    assert choose(world, 0, field).stride > 1
    pixels = some_pixels()

    difference = render_flow(world, field) - render_reference(world)

    renderer = pixel_renderer(world, 0, pixels, field)
    alone = np.asarray(flow_of(renderer, field) - renderer.reference())
    column, row = pixels.astype(int).T
    # Shared rays blur the kinks of the trilinear field by an eighth of a cell.
    assert np.linalg.norm(difference[row, column] - alone) < 0.1 * np.linalg.norm(alone)


def test_coarse_pixels_trace_every_sample():
    camera = replace(CAMERA, focal_px=(20.0, 20.0), width_px=12, height_px=9, principal_px=(5.5, 4.0))
    world = replace(scene(FixedTexture(pixel_m=0.1)), views=(View(camera=camera),))

    assert choose(world, 0, warm()).stride == 0
    assert np.abs(render_flow(world, warm()) - render_reference(world)).max() > 0


def test_luminance_has_a_gradient_in_the_field():
    world = replace(scene(ProjectedPattern(projector=PROJECTOR)), rays=RayModel(steps=16, irradiance=True))
    renderer = pixel_renderer(world, 0, some_pixels(), warm())
    weights = jax.random.normal(jax.random.key(0), (len(some_pixels()),))

    def loss(values):
        return weights @ flow_of(renderer, GridField(ROOM.lower_m, ROOM.upper_m, values))

    values = warm().values
    way = jax.random.normal(jax.random.key(1), values.shape) * 1e-5
    slope = float(jnp.vdot(jax.grad(loss)(values), way))
    # Luminance in float32 keeps four digits of such a difference; a kink of the bilinear pattern costs more.
    assert float(loss(values + way) - loss(values - way)) / 2 == pytest.approx(slope, rel=0.05)


def test_an_aperture_needs_a_lens_and_then_changes_the_image():
    world = replace(scene(FixedTexture(pixel_m=0.05)), rays=RayModel(aperture_cone=True, steps=16))
    with pytest.raises(SettingError, match="f_number"):
        render_reference(world)

    wide = replace(world, views=(View(camera=CAMERA, f_number=0.2, focal_m=0.05),))
    pinhole = replace(wide, rays=RayModel(aperture_cone=False, steps=16))
    assert np.allclose(render_reference(wide), render_reference(pinhole), atol=1e-6)
    blurred, sharp = (render_flow(w, warm()) - render_reference(w) for w in (wide, pinhole))
    assert 0.01 < np.linalg.norm(blurred - sharp) / np.linalg.norm(sharp) < 0.5
