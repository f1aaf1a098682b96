"""The map of places against the plan of a camera that was put there."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.displacement import resolve_window_px
from core.objects import ready_object
from core.plan.expected import plume_flow
from core.plan.places import moved, place_map, seen_from
from core.plan.shift_noise import shift_noise
from core.plan.signal import signal
from core.problem import Problem
from core.rays.optics import pinhole
from tests.core.plan.scenes import bench


@pytest.mark.parametrize("baseline_m", [None, 1.0])
@pytest.mark.parametrize("to_m", [(1.5, -9.0, 1.5), (2.2, -4.0, 1.5)])
def test_from_a_place_is_seen_what_a_plan_there_tells(to_m, baseline_m):
    scene = moved(bench(baseline_m=baseline_m), 0, to_m)
    flow = plume_flow(Problem(scene, ()), 20.0)
    noise = shift_noise(scene, 0, resolve_window_px(scene, scene.views[0]))
    expected = signal(scene, 0, flow, noise)
    one, picture, share = seen_from(scene, 0, flow, flow.excess_refractivity(scene.air), noise)
    assert picture == pytest.approx(expected.picture_snr, rel=0.15)
    assert one == pytest.approx(expected.snr, rel=0.25)
    assert share == pytest.approx(0.27 if to_m[1] > -5 else 0.70, abs=0.1)


def test_the_picture_keeps_its_middle_on_the_wall():
    before = bench()
    after = moved(before, 0, (0.4, 0.5, 2.1))
    with jax.enable_x64(True):
        eye, other = (pinhole(scene.views[0].camera) for scene in (before, after))
        middle = jnp.array([127.5, 127.5])
        ray = np.asarray(eye.direction(middle))
        point_m = np.asarray(eye.position_m) + (3.0 - float(eye.position_m[1])) / ray[1] * ray
        assert np.asarray(other.project(jnp.asarray(point_m))) == pytest.approx([127.5, 127.5], abs=1e-6)


def test_there_is_no_place_inside_an_object():
    scene = bench()
    cabinet = replace(
        ready_object("cabinet", "cabinet", (1.5, 0.9, 0.0), None),
        upper_m=(3.0, 1.5, 3.0),
        lower_m=(0.0, 0.5, 0.0),
    )
    flow = plume_flow(Problem(scene, ()), 20.0)
    inside = replace(scene.views[0].camera, position_m=(1.5, 0.3, 1.5))
    scene = replace(scene, views=(replace(scene.views[0], camera=inside),), objects=(cabinet,))
    found = place_map(scene, 0, flow)
    hidden = (found.y_m > 0.5) & (found.y_m < 1.5)
    assert hidden.any()
    assert np.isnan(found.picture_snr[hidden]).all()
    assert found.picture_snr.shape == (len(found.y_m), len(found.x_m))
