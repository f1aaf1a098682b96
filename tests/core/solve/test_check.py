"""Problems that no iteration can save are refused before the first one."""

import dataclasses

import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.problem import PlaneData, Problem, SensorData, ShiftMeasurement
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall
from core.setting import SettingError
from core.solve.check import check_problem
from core.solve.grid.grid import GridSettings
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, Weights, losses_of

PATCH = Patch(wall="x_min", lower_m=(1.0, 2.0), upper_m=(2.0, 2.5))
INLET = Inlet(patch=PATCH, temperature_k=300.0, velocity_m_s=(0.5, 0.0, 0.0))


def problem(boundary=(INLET,), sensors=(), **shift):
    scene = Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0)),
        views=(
            View(
                camera=looking_along_y(
                    position_m=(2.0, -27.0, 1.5), width_px=64, height_px=64, focal_px=500.0
                )
            ),
        ),
        light=FixedTexture(),
        boundary=tuple(boundary),
    )
    centres = np.array([[10.0, 10.0], [30.0, 30.0]])
    given = {
        "centres_px": centres,
        "displacement_px": np.zeros((2, 2)),
        "information_per_px2": np.broadcast_to(np.eye(2) * 1e6, (2, 2, 2)).copy(),
        "window_px": 8,
    }
    return Problem(scene, (ShiftMeasurement(**{**given, **shift}),), (), tuple(sensors))


def test_a_sound_problem_passes():
    check_problem(problem(), "bos+pde+boundary")


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"displacement_px": np.full((2, 2), np.nan)}, "saturated"),
        ({"information_per_px2": np.full((2, 2, 2), np.eye(2) * 1e18)}, "noise is zero"),
        ({"information_per_px2": np.zeros((2, 2, 2))}, "no window with texture"),
        (
            {
                "centres_px": np.zeros((0, 2)),
                "displacement_px": np.zeros((0, 2)),
                "information_per_px2": np.zeros((0, 2, 2)),
            },
            "sees no window",
        ),
        ({"information_per_px2": np.broadcast_to(np.eye(2) * 0.1, (2, 2, 2))}, "better than 1 px"),
        ({"boundary": ()}, "Nothing is known"),
        ({"boundary": (INLET, Outlet(patch=PATCH))}, "overlap"),
        (
            {"boundary": (dataclasses.replace(INLET, velocity_m_s=(-0.5, 0.0, 0.0)),)},
            "does not enter the room",
        ),
        ({"boundary": (Wall(wall="x_max"), Wall(wall="x_max", no_slip=False))}, "described 2 times"),
    ],
)
def test_bad_problems_are_refused_with_the_reason(wrong, reason):
    with pytest.raises(SettingError, match=reason):
        check_problem(problem(**wrong), "bos+pde+boundary")


ROUND = [Wall(wall=w) for w in ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")]  # type: ignore[arg-type]


def plane(kelvin):
    axis_m = np.linspace(0.0, 3.0, 31)
    shape = (31, 31)
    return PlaneData("x_min", axis_m, axis_m, np.full(shape, kelvin), np.zeros(shape), np.zeros((*shape, 3)))


def test_an_inlet_that_the_measured_plane_contradicts_is_refused():
    given = problem()
    check_problem(Problem(given.scene, given.shifts, (plane(301.0),)), "bos+boundary")
    with pytest.raises(SettingError, match=r"stated at 300 K, and the plane x_min has 295 K"):
        check_problem(Problem(given.scene, given.shifts, (plane(295.0),)), "bos+boundary")


def test_a_plane_given_twice_or_in_celsius_is_refused():
    given = problem()
    with pytest.raises(SettingError, match="given 2 times"):
        check_problem(Problem(given.scene, given.shifts, (plane(300.0), plane(300.0))), "bos+boundary")
    with pytest.raises(SettingError, match="expected kelvin"):
        check_problem(Problem(given.scene, given.shifts, (plane(-5.0),)), "bos+boundary")


def test_air_that_enters_a_closed_room_is_refused():
    with pytest.raises(SettingError, match="mass cannot be conserved"):
        check_problem(problem([INLET, *ROUND]), "pde+boundary")
    away = Outlet(patch=Patch(wall="x_max", lower_m=(1.0, 2.0), upper_m=(2.0, 2.5)))
    check_problem(problem([INLET, away, *ROUND]), "pde+boundary")


def test_a_problem_without_images_needs_a_regime_without_them():
    bare = problem()
    bare = Problem(bare.scene, ())
    with pytest.raises(SettingError, match="no image"):
        check_problem(bare, "bos+boundary")
    check_problem(bare, "pde+boundary")


def test_a_sensor_outside_the_room_is_refused():
    sensor = SensorData(np.array([[9.0, 1.0, 1.0]]), *[np.ones(1)] * 2, np.zeros((1, 3)), np.ones(1))
    with pytest.raises(SettingError, match="outside the room"):
        check_problem(problem(sensors=[sensor]), "bos+boundary")


def test_a_view_that_sees_nothing_away_from_the_walls_is_refused():
    wide = problem(centres_px=np.array([[1.0, 1.0], [62.0, 62.0]]))
    with pytest.raises(SettingError, match="sees nothing of the room"):
        losses_of(wide, frame_of(wide), "bos+boundary", Weights(), DataModel(), (5, 5, 5), 9)


def test_a_regime_is_a_list_of_losses():
    given = problem([INLET, Wall(wall="x_max", thermal="adiabatic")])
    names = {}
    for regime in ("bos+boundary", "pde+boundary", "bos+pde+boundary"):
        losses = losses_of(
            given, frame_of(given), regime, Weights(smoothness=0.0), DataModel(), (5, 5, 5), 33
        )
        names[regime] = [loss.name for loss in losses]
    assert names["bos+boundary"] == ["bos", "boundary", "gauge"]
    assert names["pde+boundary"] == ["boundary", "gauge", "pde"]
    assert names["bos+pde+boundary"] == ["bos", "boundary", "gauge", "pde"]
    with pytest.raises(SettingError, match="no regime"):
        losses_of(given, frame_of(given), "bos", Weights(), DataModel(), (5, 5, 5), 9)


def test_a_grid_that_cannot_be_halved_is_refused():
    with pytest.raises(SettingError, match="power of two"):
        GridSettings(cells=48, coarsest=32)


def test_stripes_are_refused_by_what_marches_no_room():
    across = np.broadcast_to(np.diag([1e6, 1e-6]), (2, 2, 2)).copy()
    striped = problem(information_per_px2=across)
    check_problem(striped, "bos+pde+boundary")
    with pytest.raises(SettingError, match="texture in both directions"):
        losses_of(striped, frame_of(striped), "bos+boundary", Weights(), DataModel(), (5, 5, 5), 9)
