"""The upright column of air that a solve starts from: a known plane's, else that of the air that leaves."""

import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.problem import PlaneData, Problem
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View
from core.solve.nondimensional import RoomFrame, frame_of, height_profile

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
INLET = Inlet(
    patch=Patch(wall="x_min", lower_m=(1.0, 2.0), upper_m=(2.0, 3.0)),
    temperature_k=296.0,
    velocity_m_s=(0.3, 0.0, 0.0),
)
OUTLET = Outlet(
    patch=Patch(wall="x_min", lower_m=(1.0, 0.0), upper_m=(2.0, 1.0)),
    mean_temperature_k=295.0,
    temperature_std_k=0.5,
)
CAMERA = looking_along_y(position_m=(2.0, -27.0, 1.5), width_px=200, height_px=150, focal_px=1500.0)
SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), boundary=(INLET, OUTLET))
PRESSURE_M2_S2 = np.linspace(-0.05, 0.02, 9)
PLANE = PlaneData(
    wall="x_max",
    first_m=np.linspace(0.0, 3.0, 4),
    second_m=np.linspace(0.0, 3.0, 9),
    temperature_k=np.broadcast_to(np.linspace(294.0, 297.0, 9), (4, 9)),
    pressure_m2_s2=np.broadcast_to(PRESSURE_M2_S2, (4, 9)),
    velocity_m_s=np.zeros((4, 9, 3)),
)


def column(problem: Problem) -> tuple[RoomFrame, np.ndarray, np.ndarray]:
    """The frame, and T [K] and p [m2/s2] over height."""
    frame = frame_of(problem)
    found = height_profile(problem, frame, frame.vertices((3, 3, 9)))
    kelvin = frame.scales.reference_k + frame.scales.excess_k * np.asarray(found.temperature[0, 0])
    return frame, kelvin, frame.scales.pressure_m2_s2 * np.asarray(found.pressure[0, 0])


def test_a_known_plane_gives_both_temperature_and_pressure_also_beside_a_measured_outlet():
    _, kelvin, pressure = column(Problem(SCENE, (), (PLANE,)))
    np.testing.assert_allclose(kelvin, np.linspace(294.0, 297.0, 9), atol=1e-4)
    np.testing.assert_allclose(pressure, PRESSURE_M2_S2, atol=1e-6)


def test_without_a_plane_it_is_the_column_of_the_air_that_leaves():
    _, kelvin, pressure = column(Problem(SCENE, ()))
    np.testing.assert_allclose(kelvin, 295.0, atol=1e-4)
    ambient_k = SCENE.air.ambient_temperature_k
    weight_m_s2 = np.gradient(pressure, np.linspace(0.0, 3.0, 9))
    assert weight_m_s2 == pytest.approx(9.81 * (295.0 - ambient_k) / ambient_k, rel=0.02)
    # Zero where the air leaves: the outlet's middle, 0.5 m up.
    assert np.interp(0.5, np.linspace(0.0, 3.0, 9), pressure) == pytest.approx(0.0, abs=1e-5)
