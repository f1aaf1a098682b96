"""A wall of glass before the camera: its thermal layer makes most of the signal, and is no air of the room."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.known_temperature import VertexGrid
from core.problem import Problem, ShiftMeasurement
from core.rays.operator import build
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, SolveModel, View, Wall
from core.solve.draft.draft import solve_draft

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.7))
NOISE_PX = 2e-5
LAYER_K = 6.0
CAMERA = looking_along_y(position_m=(2.0, -1.0, 1.35), width_px=160, height_px=160, focal_px=150.0)
SCENE = Scene(
    room=ROOM,
    views=(View(camera=CAMERA, drift_std_px=0.0),),
    light=FixedTexture(),
    boundary=(
        Outlet(
            patch=Patch(wall="x_min", lower_m=(1.0, 0.2), upper_m=(2.0, 0.6)),
            mean_temperature_k=297.15,
            temperature_std_k=0.3,
        ),
        Inlet(
            patch=Patch(wall="x_min", lower_m=(1.0, 2.0), upper_m=(2.0, 2.3)),
            temperature_k=303.15,
            velocity_m_s=(0.4, 0.0, 0.0),
        ),
    ),
    solve=SolveModel(grid=20),
)
FINE = VertexGrid(ROOM, (49, 37, 33))


def room_k() -> np.ndarray:
    """Layers of air with a warm patch under the ceiling, which is long along the view."""
    x, _, z = np.meshgrid(*FINE.axes_m, indexing="ij")
    return 4.0 + 0.2 * (z - 1.35) + 0.6 * np.exp(-((x - 1.0) ** 2 + (z - 2.1) ** 2) / 0.3)


def shown(excess_k: np.ndarray) -> ShiftMeasurement:
    places = np.arange(4.0, 160.0, 8.0)
    centres = np.stack(np.meshgrid(places, places), -1).reshape(-1, 2)
    operator = build(SCENE, 0, centres, FINE.shape, 8.0)
    shift = np.asarray(
        operator.apply(SCENE.air.excess_refractivity(jnp.asarray(excess_k, jnp.float32))), np.float64
    )
    seen = np.abs(np.asarray(operator.px_per_m)).sum((1, 2)) > 0
    noise = NOISE_PX * np.random.default_rng(1).standard_normal(shift.shape)
    information = np.broadcast_to(np.eye(2) / NOISE_PX**2, (len(shift), 2, 2)).copy()
    return ShiftMeasurement(centres, shift + noise, information, 8).at(seen)


def error_k(scene: Scene, measured: ShiftMeasurement) -> float:
    """Of the departures from the mean at each height, within the room."""
    found = solve_draft(Problem(scene, (measured,)))
    at = np.meshgrid(found.x_m, found.y_m, found.z_m, indexing="ij")
    true = 4.0 + 0.2 * (at[2] - 1.35) + 0.6 * np.exp(-((at[0] - 1.0) ** 2 + (at[2] - 2.1) ** 2) / 0.3)
    wrong = (found.temperature_k - 293.15 - true)[1:-1, 1:-1, 1:-1]
    return float(np.std(wrong - wrong.mean((0, 1))))


@pytest.fixture(scope="module")
def glass() -> ShiftMeasurement:
    cold = room_k()
    cold[:, 0] -= LAYER_K
    return shown(cold)


def test_the_layer_makes_most_of_the_signal(glass):
    clear = shown(room_k())
    rms = [np.sqrt(np.mean(one.displacement_px**2)) for one in (glass, clear)]
    assert rms[0] > 2.0 * rms[1]


def test_a_layer_that_may_be_there_is_not_taken_for_air(glass):
    adiabatic = Wall(wall="y_min", thermal="adiabatic")
    without = dataclasses.replace(SCENE, boundary=(*SCENE.boundary, adiabatic))
    assert error_k(SCENE, glass) < 0.5 * error_k(without, glass)


def test_without_a_layer_hardly_anything_is_lost():
    adiabatic = Wall(wall="y_min", thermal="adiabatic")
    without = dataclasses.replace(SCENE, boundary=(*SCENE.boundary, adiabatic))
    clear = shown(room_k())
    assert error_k(SCENE, clear) < 1.5 * error_k(without, clear)
