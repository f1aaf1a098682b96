from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.discrepancy import Correction, temperature_correction
from core.estimate.observation import Observations, observations
from core.estimate.posterior import hydrostatic_m2_s2, hydrostatic_variance_m4_s4
from core.geometry import Box, Vector3, WallName, looking_along_y
from core.problem import Problem, SensorData, ShiftMeasurement
from core.scene import FixedTexture, Outlet, Patch, Scene, View
from core.view_frame import turn_to

VERTICES = (17, 13, 15)
# What the room predicts everywhere [K above ambient].
PREDICTED_K = 4.0
DEPARTURE_K = 0.2
# The share of it that is expected to be wrong.
WRONG = 0.18


def data(leaving_k: float | None = None, sensors: tuple[SensorData, ...] = ()) -> Observations:
    """No pictures: thermometers alone."""
    camera = looking_along_y(position_m=(1.5, -8.0, 1.2), width_px=64, height_px=48, focal_px=150.0)
    mean_k = None if leaving_k is None else 293.15 + leaving_k
    exhaust = Outlet(
        patch=Patch(wall="x_min", lower_m=(-0.3, 0.2), upper_m=(0.3, 0.6)),
        mean_temperature_k=mean_k,
        temperature_std_k=0.05,
    )
    scene = Scene(
        room=Box(lower_m=(0.0, -1.0, 0.0), upper_m=(3.0, 1.0, 2.4)),
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(exhaust,),
    )
    return observations(Problem(scene, (), (), sensors), VERTICES)


def corrected(seen: Observations, level_std_k: float, outlet_std_k: float = 0.0) -> Correction:
    residual = seen.values()[0] - PREDICTED_K
    room = np.full(VERTICES, PREDICTED_K)
    return temperature_correction(seen, room, residual, DEPARTURE_K, level_std_k, WRONG, outlet_std_k)


def test_what_leaves_moves_the_level_as_far_as_it_was_open():
    seen = data(leaving_k=PREDICTED_K + 0.3)
    free, held = corrected(seen, 1.0), corrected(seen, 0.01)

    np.testing.assert_allclose(free.excess_k, 0.3, atol=0.02)
    assert np.ptp(free.excess_k) < 0.01
    # What contradicts a level that is known is an error of the place.
    assert np.abs(held.excess_k).max() < 0.1
    assert held.point_k2 > 10 * (0.1 * DEPARTURE_K) ** 2
    assert (free.variance_k2 < 0.02 * free.prior_variance_k2).all()


def test_an_outlet_that_may_draw_from_elsewhere_says_less_of_the_level():
    seen = data(leaving_k=PREDICTED_K + 0.3)
    near, elsewhere = corrected(seen, 0.3), corrected(seen, 0.3, outlet_std_k=0.6)

    assert elsewhere.excess_k.mean() < 0.4 * near.excess_k.mean()
    # An outlet's 0.6 K beside a level known to 0.3 K: 0.27 K are left.
    np.testing.assert_allclose(np.sqrt(elsewhere.variance_k2), 0.27, atol=0.03)
    assert elsewhere.level_std_k == pytest.approx(0.27, abs=0.03)
    assert near.level_std_k < 0.1


def pole(wrong_k: float) -> SensorData:
    """Nine thermometers above one another, wrong by so much to both sides of the prediction."""
    z_m = np.linspace(0.2, 2.2, 9)
    positions_m = np.stack([np.full(9, 1.5), np.zeros(9), z_m], axis=1)
    read_k = 293.15 + PREDICTED_K + wrong_k * np.cos(np.pi * z_m / 2.4)
    nothing = np.full((9, 3), np.nan)
    return SensorData(positions_m, read_k, np.full(9, 0.02), nothing, np.full(9, 0.1))


def test_a_room_that_thermometers_contradict_is_corrected_further_and_is_less_certain():
    z_m = np.linspace(0.0, 2.4, VERTICES[2])
    confirmed, contradicted = (corrected(data(sensors=(pole(k),)), 0.01) for k in (0.02, 1.0))

    # One point says less of the mean along y, which the correction is, than it is itself wrong.
    share = np.polyfit(np.cos(np.pi * z_m / 2.4), contradicted.excess_k[8, 0], 1)[0]
    assert 0.3 < share < 0.9
    assert confirmed.point_k2 < 4 * (0.1 * DEPARTURE_K) ** 2
    assert contradicted.point_k2 > 100 * confirmed.point_k2
    assert contradicted.variance_k2.mean() > 10 * confirmed.variance_k2.mean()


AHEAD: dict[WallName, Vector3] = {
    "y_max": (1.5, -8.0, 1.2),
    "x_max": (0.0, -8.0, 1.2),
    "z_max": (1.5, -8.0, 0.0),
}


def pictures(walls: Sequence[WallName], excess_k: np.ndarray) -> Observations:
    """Views of these walls, each from 8 m before it, with a twentieth of their rms shift as noise."""
    across_px = np.arange(4.0, 384.0, 8.0)
    centres_px = np.stack(np.meshgrid(across_px, across_px), -1).reshape(-1, 2)
    still_px, unit = np.zeros_like(centres_px), np.tile(np.eye(2), (len(centres_px), 1, 1))
    nothing = tuple(ShiftMeasurement(centres_px, still_px, 1e8 * unit, 8) for _ in walls)
    views = []
    for wall in walls:
        seen = looking_along_y(position_m=AHEAD[wall], width_px=384, height_px=384, focal_px=900.0)
        views.append(View(name=wall, wall=wall, camera=turn_to(wall).back().optics(seen)))
    scene = replace(data().scene, views=tuple(views))
    refractivity = scene.air.excess_refractivity(jnp.asarray(excess_k, jnp.float32))
    shifts = []
    for n, block in enumerate(observations(Problem(scene, nothing), VERTICES).shifts):
        shift_px = np.asarray(block.operator.apply(refractivity))
        std_px = 0.05 * float(np.sqrt(np.mean(shift_px**2)))
        shift_px = shift_px + std_px * np.random.default_rng(n).normal(size=shift_px.shape)
        shifts.append(replace(nothing[n], displacement_px=shift_px, information_per_px2=unit / std_px**2))
    return observations(Problem(scene, tuple(shifts)), VERTICES)


WAVE_X, WAVE_Y, WAVE_Z = (
    np.cos(np.pi * k * np.linspace(0.0, 1.0, n)) for k, n in zip((2, 1, 1), VERTICES, strict=True)
)


@pytest.mark.parametrize(
    ("walls", "wave"),
    [
        (("y_max",), WAVE_X[:, None, None] * WAVE_Z),
        (("x_max",), WAVE_Y[:, None] * WAVE_Z),
        (("y_max", "x_max"), WAVE_X[:, None, None] * WAVE_Z + WAVE_Y[:, None] * WAVE_Z),
        (("z_max",), WAVE_X[:, None, None] * WAVE_Y[:, None]),
    ],
)
def test_what_views_see_is_corrected_along_whatever_axis_they_look(
    walls: tuple[WallName, ...], wave: np.ndarray
):
    truth_k = PREDICTED_K + 0.5 * np.broadcast_to(wave, VERTICES)
    seen, room = pictures(walls, truth_k), np.full(VERTICES, PREDICTED_K)
    # The room as it is predicted shifts nothing: its air is even.
    found = temperature_correction(seen, room, seen.values()[0], DEPARTURE_K, 0.1, 1.0)

    wrong_k = PREDICTED_K + found.excess_k - truth_k
    std_k = np.sqrt(found.variance_k2 + found.point_k2)
    assert np.sqrt(np.mean(wrong_k**2)) < 0.5 * np.std(truth_k)
    assert np.mean(np.abs(wrong_k) < 1.96 * std_k) > 0.9
    # With itself a vertex goes as far as its variance; with the mean over the room, as the level is known.
    here = np.zeros(VERTICES)
    here[5, 6, 7] = 1.0
    std_k2 = np.broadcast_to(found.variance_k2, VERTICES)
    assert found.goes_with(here)[5, 6, 7] == pytest.approx(std_k2[5, 6, 7], rel=1e-6)
    even = np.full(VERTICES, 1.0 / np.prod(VERTICES))
    assert np.sum(even * found.goes_with(even)) == pytest.approx(found.level_std_k**2, rel=1e-6)


def test_without_data_nothing_moves_and_nothing_is_learnt():
    found = corrected(data(), 0.5)
    assert not found.excess_k.any()
    np.testing.assert_allclose(found.variance_k2, found.prior_variance_k2, rtol=1e-6)


def test_warmer_air_carries_more_pressure_up():
    z_m = np.linspace(0.0, 2.4, 15)
    seen = data()
    carried = hydrostatic_m2_s2(Problem(seen.scene, ()), z_m, np.full((4, 4, 15), 2.0))
    np.testing.assert_allclose(carried, 9.81 / 293.15 * 2.0 * z_m, rtol=1e-6)


def test_an_open_level_leaves_pressure_open_at_floor_and_ceiling_and_not_half_way_up():
    z_m = np.linspace(0.0, 2.4, 15)
    std = np.sqrt(hydrostatic_variance_m4_s4(Problem(data().scene, ()), z_m, np.full((4, 4, 15), 0.2**2)))
    assert std.shape == (4, 4, 15)
    np.testing.assert_allclose(std[2, 1], 9.81 / 293.15 * 0.2 * np.abs(z_m - 1.2), rtol=1e-6, atol=1e-12)
