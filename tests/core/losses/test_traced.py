"""Rays through the representation itself: the paper's image loss, against the vertex grid's."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.losses.boussinesq import Scales
from core.losses.representation import Unknowns, points_of
from core.losses.traced import TracedLoss, rendered_view, traced_windows
from core.mlp import MlpSettings, initial_mlp
from core.problem import ImagePair, ShiftMeasurement
from core.rays.operator import build
from core.render.light import pattern_image, sample_pattern
from core.render.pixel_geometry import pixel_geometry
from core.scene import FixedTexture, ProjectedPattern, Scene, View
from core.setting import SettingError

CAMERA = looking_along_y(position_m=(1.5, -27.0, 1.5), width_px=48, height_px=48, focal_px=440.0)
PROJECTOR = looking_along_y(position_m=(2.5, -27.0, 1.5), width_px=64, height_px=64, focal_px=560.0)
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 3.0))
PRINT = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(pixel_m=0.05))
LIT = dataclasses.replace(PRINT, light=ProjectedPattern(projector=PROJECTOR))
SCALES = Scales(length_m=3.0, velocity_m_s=0.5, excess_k=10.0, reference_k=293.15)
# The vertex grid's slopes jump at its cells' faces: averaged over a cell they do not.
CELL_PX = 1.1
SPANS = ((0.0, 1.0, 41), (0.0, 1.0, 41), (0.0, 1.0, 41))


def network():
    return initial_mlp(MlpSettings(hidden_layers=2, width=16), (0.0,) * 3, (1.0,) * 3, jax.random.key(1))


def traced(view, **options):
    return TracedLoss((view,), SCALES, PRINT.air, ROOM.lower_m, steps=48, **options)


@pytest.mark.parametrize("scene", [PRINT, LIT], ids=["print", "projector"])
def test_rays_through_the_network_see_what_the_vertex_grid_sees(scene):
    centres = np.stack(np.meshgrid(np.arange(5.0, 44, 4), np.arange(5.0, 44, 4)), -1).reshape(-1, 2)
    air = network()
    points = jnp.asarray(points_of(SPANS), jnp.float32)
    excess_k = SCALES.excess_k * jax.jit(lambda n, p: n.at(p).temperature)(air, points)
    excess = PRINT.air.excess_refractivity(excess_k).reshape(41, 41, 41)
    on_grid = np.asarray(
        jax.jit(lambda o, e: o.apply(e))(build(scene, 0, centres, (41, 41, 41), CELL_PX), excess), np.float64
    )
    information = np.broadcast_to(np.eye(2), (len(centres), 2, 2)).copy()
    shift = ShiftMeasurement(centres, np.zeros_like(centres), information, 1)
    view = traced_windows(scene, 0, shift, 0.0, np.zeros((len(centres), 2, 6)))

    loss = traced(view)
    (rows,) = jax.jit(lambda u: loss.rows(u.representation, u, None))(Unknowns(air))

    found = np.asarray(rows) * rows.size**0.5
    # Second order in cells of 7 cm; measured 0.011 for the projector, whose signal is a small difference.
    assert np.abs(found - on_grid).max() < 0.02 * np.abs(on_grid).max()
    assert np.abs(on_grid).max() > 1e-6


def test_the_rendered_picture_of_the_true_air_is_the_flow_image_and_its_gradient_is_right():
    rng = np.random.default_rng(0)
    offsets = rng.uniform(-0.5, 0.5, (48, 48, 2, 2))
    row, column = np.mgrid[0:48, 0:48]
    positions = (np.stack([column, row], -1)[:, :, None] + offsets).reshape(-1, 2)
    geometry = pixel_geometry(LIT, 0, positions)
    light = sample_pattern(jnp.asarray(pattern_image(LIT)), geometry.cell, geometry.fraction_px)
    still = np.asarray(light * geometry.weight, np.float64).reshape(48, 48, 2).mean(-1)
    view = rendered_view(LIT, 0, ImagePair(still, still, 1e-4, offsets))
    loss = traced(view, pixels=64)
    value = jax.jit(lambda u: (loss.rows(u.representation, u, jax.random.key(0))[0] ** 2).sum())
    at_rest = jax.tree.map(jnp.zeros_like, network())
    # No excess anywhere: the model's picture is the reference to float32.
    assert float(value(Unknowns(at_rest))) < 1e-6

    start = network()
    slope = jax.jit(jax.grad(value))(Unknowns(start)).representation
    towards = jax.tree.map(lambda g: g / jnp.sqrt(sum(jnp.vdot(a, a) for a in jax.tree.leaves(slope))), slope)
    step = 0.05
    moved = [jax.tree.map(lambda a, b, s=s: a + s * b, start, towards) for s in (step, -step)]
    difference = (float(value(Unknowns(moved[0]))) - float(value(Unknowns(moved[1])))) / (2 * step)
    expected = float(
        sum(jnp.vdot(a, b) for a, b in zip(*map(jax.tree.leaves, (slope, towards)), strict=True))
    )
    # float32 differences of a smooth function: a few per cent.
    assert difference == pytest.approx(expected, rel=0.05)


def test_a_motion_of_the_camera_adds_to_the_shift():
    motions = np.zeros((1, 2, 6))
    motions[0, :, 0] = (0.5, -0.25)
    shift = ShiftMeasurement(np.array([[20.0, 20.0]]), np.zeros((1, 2)), np.eye(2)[None], 1)
    loss, air = traced(traced_windows(PRINT, 0, shift, 0.0, motions)), network()
    rows = [
        loss.rows(air, Unknowns(air, jnp.array([[q, 0.0, 0.0, 0.0, 0.0, 0.0]])), None)[0] for q in (0.0, 2.0)
    ]
    weight = (loss.weight / rows[0].size) ** 0.5
    np.testing.assert_allclose((rows[1] - rows[0]).ravel(), weight * np.array([1.0, -0.5]), rtol=1e-4)


def test_missing_samples_are_refused():
    pair = ImagePair(np.zeros((4, 4)), np.zeros((4, 4)), 1.0)
    with pytest.raises(SettingError, match="sample positions"):
        rendered_view(PRINT, 0, pair)
