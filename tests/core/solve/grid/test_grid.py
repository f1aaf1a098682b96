"""The grid's descent: resumed, stopped and broken in the middle."""

import numpy as np
import pytest

from core.checkpoint import ForeignCheckpointError, newest
from core.geometry import Box, looking_along_y
from core.problem import PlaneData, Problem, SensorData, ShiftMeasurement
from core.result import Outcome, Solution
from core.scene import FixedTexture, PlaneField, Scene, View
from core.setting import SettingError
from core.solve.grid.grid import GridSettings, solve_grid
from core.solve.regime import Weights
from core.watch import StoppedError, Watch
from tests.core.solve.memory import Memory

SETTINGS = GridSettings(cells=8, coarsest=4, steps_a_level=3, cg_iterations=15, settled=0.0)


def problem(sensor_std_k=0.5):
    camera = looking_along_y(position_m=(1.5, -27.0, 1.5), width_px=64, height_px=64, focal_px=550.0)
    scene = Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 3.0)),
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(PlaneField(file="plane"),),
    )
    centres = np.stack(np.meshgrid(np.arange(9.5, 60, 5), np.arange(9.5, 60, 5)), -1).reshape(-1, 2)
    shift = 1e-3 * np.sin(centres / 9.0)
    # A thing before this window moved.
    shift[40] = (2.0, 0.0)
    information = np.broadcast_to(np.eye(2) * 1e8, (len(centres), 2, 2)).copy()
    axis_m = np.linspace(0.0, 3.0, 9)
    warm = 293.15 + np.broadcast_to(axis_m, (9, 9))
    plane = PlaneData("x_min", axis_m, axis_m, np.array(warm), np.zeros((9, 9)), np.full((9, 9, 3), 0.1))
    # Data, not structure: every problem here runs the same compiled steps.
    sensor = SensorData(
        np.array([[1.0, 1.0, 1.0]]),
        np.array([294.0]),
        np.array([sensor_std_k]),
        np.full((1, 3), np.nan),
        np.ones(1),
    )
    return Problem(scene, (ShiftMeasurement(centres, shift, information, 5),), (plane,), (sensor,))


def after(calls):
    count = iter(range(calls))
    return lambda: next(count, None) is None


def same(a: Solution, b: Solution):
    for name in ("temperature_k", "pressure_m2_s2", "velocity_m_s"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@pytest.fixture(scope="module")
def whole():
    events = []
    solution = solve_grid(problem(), SETTINGS, Watch(lambda row, growing: events.append(row)))
    assert [e["cells"] for e in events] == [4.0] * 3 + [8.0] * 3
    assert events[-1]["loss_after"] < events[0]["loss"]
    return solution


def test_a_window_that_did_not_move_as_air_is_told(whole):
    assert any(
        note.startswith("1 of 121 windows (0.83 %) show a shift that no air has") for note in whole.notes
    )


# Bursts of conjugate gradients ask now and then: stopped at once, within the first level, in the second.
@pytest.mark.parametrize("calls", [0, 4, 11], ids=str)
def test_a_stopped_solve_goes_on_to_bitwise_the_same_end(whole, calls):
    store = Memory()
    with pytest.raises(StoppedError):
        solve_grid(problem(), SETTINGS, Watch(store=store, should_stop=after(calls)))
    header = newest(store).header

    resumed = solve_grid(problem(), SETTINGS, Watch(store=store))

    assert len(header["history"]) == header["step"] < 6
    assert len(resumed.history) == 6
    same(resumed, whole)


def test_every_step_that_was_kept_leads_to_the_same_end(whole):
    store = Memory()
    solve_grid(problem(), SETTINGS, Watch(store=store))
    for content in store.kept:
        same(solve_grid(problem(), SETTINGS, Watch(store={"00000001": content})), whole)


def test_a_checkpoint_of_other_weights_is_refused():
    store = Memory()
    with pytest.raises(StoppedError):
        solve_grid(problem(), SETTINGS, Watch(store=store, should_stop=after(0)))
    other = GridSettings(cells=8, coarsest=4, weights=Weights(pde=1.0))
    with pytest.raises(SettingError, match="were changed"):
        solve_grid(problem(), other, Watch(store=store))


def test_a_checkpoint_of_other_images_is_refused():
    store = Memory()
    with pytest.raises(StoppedError):
        solve_grid(problem(), SETTINGS, Watch(store=store, should_stop=after(0)))
    with pytest.raises(ForeignCheckpointError, match="were changed"):
        solve_grid(problem(sensor_std_k=0.25), SETTINGS, Watch(store=store))


def test_a_weight_beyond_float32_ends_with_the_last_good_state_and_advice():
    found = solve_grid(problem(sensor_std_k=1e-25), SETTINGS)
    assert found.outcome is Outcome.nonfinite
    assert "last good state" in found.outcome.value
    assert np.isfinite(found.temperature_k).all()
    assert np.isfinite(found.velocity_m_s).all()


def test_a_time_limit_ends_a_solve_by_name():
    limited = GridSettings(cells=8, coarsest=4, settled=0.0, time_limit_s=0.0)
    found = solve_grid(problem(), limited)
    assert found.outcome is Outcome.time_limit
    assert len(found.history) <= 2
