import json
import os
import signal
import time

import pytest

from app.capture.burst import Order, interruptible, take, take_order
from app.capture.watched import BurstWatch
from app.experiment.captures import load_capture
from app.experiment.folder import ExperimentSettings, create_experiment
from app.rig.frame_report import judge_frame, write_picture
from core.geometry import Box, Optics
from core.scene import FixedTexture, Scene, View
from drivers.burst import BurstOutcome, CapturePlan
from drivers.clock import SystemClock
from drivers.errors import DeviceSettingError
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern


@pytest.fixture
def experiment(tmp_path):
    optics = Optics(
        position_m=(0.0, -3.0, 0.0), rotation_rad=(0.0, 0.0, 0.0), width_px=128, height_px=96,
        focal_px=(200.0, 200.0), principal_px=(63.5, 47.5),
    )  # fmt: skip
    room = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))
    scene = Scene(room=room, views=(View(camera=optics),), light=FixedTexture())
    return create_experiment(tmp_path / "experiment", ExperimentSettings(scene=scene))


def make_camera(**options):
    view = pattern()
    return SimulatedCamera(lambda: view, seed=1, **options)


def test_a_burst_becomes_a_capture_of_the_experiment(experiment):
    taken = take(make_camera(), experiment, CapturePlan(role="reference", frames=4))
    assert experiment.latest_capture("reference") == taken.folder
    assert load_capture(taken.folder).images[0].frames == 4


def test_an_aborted_burst_is_kept_or_discarded_as_said(experiment):
    for on_abort in ("keep", "discard"):
        done = []
        plan = CapturePlan(role="flow", frames=50)
        watch = BurstWatch(done.append, stop=lambda n=done, on=on_abort: on if len(n) >= 3 else None)
        taken = take(make_camera(), experiment, plan, watch=watch)
        assert "3 of 50 frames" in taken.shortfall
        assert taken.burst.outcome is BurstOutcome.ABORTED
        assert (taken.folder is None) == (on_abort == "discard")
    folders = list(experiment.captures_folder.iterdir())
    assert len(folders) == 1
    assert load_capture(folders[0]).images[0].frames == 3


def test_a_sequence_is_one_capture_a_burst_with_its_times(experiment):
    camera = make_camera(clock=SystemClock(), frame_rate_hz=200.0, exposure_s=0.004)
    plan = CapturePlan(role="flow", frames=3, settle_frames=0)
    begun = []
    taken = take_order(camera, experiment, Order(plan, 2, 0.5), BurstWatch(begun=begun.append), "first")
    assert [one.folder for one in taken] == begun
    assert begun[0].name == "first"
    times = [load_capture(one.folder).manifest["origin"]["sequence"] for one in taken]
    assert [(t["number"], t["bursts"], t["every_s"]) for t in times] == [(0, 2, 0.5), (1, 2, 0.5)]
    assert times[1]["due_s"] == 0.5
    assert times[1]["began_s"] >= 0.5  # how late it may be is up to the machine
    with pytest.raises(DeviceSettingError, match="apart"):
        take_order(camera, experiment, Order(CapturePlan(role="flow", frames=300), 2, 0.5))
    with pytest.raises(DeviceSettingError, match="every_s is 0"):
        Order(plan, bursts=2)


def test_what_fails_before_the_first_frame_leaves_nothing_and_after_it_what_was_taken(experiment):
    with pytest.raises(DeviceSettingError):
        take(make_camera(), experiment, CapturePlan(frames=4, gain=100.0))
    assert list(experiment.captures_folder.iterdir()) == []

    def full(taken, view):
        if taken.moments.frames == 3:
            raise OSError("No space left on device")

    with pytest.raises(OSError, match="No space left"):
        take(make_camera(), experiment, CapturePlan(frames=4), watch=BurstWatch(frame=full))
    (left,) = experiment.captures_folder.iterdir()
    assert not load_capture(left).complete


def test_a_flow_with_other_settings_than_its_reference_is_told(experiment):
    camera = make_camera(exposure_s=0.01)
    take(camera, experiment, CapturePlan(role="reference", frames=2))
    same = take(camera, experiment, CapturePlan(role="flow", frames=2)).burst.verdicts
    other = take(camera, experiment, CapturePlan(role="flow", frames=2, exposure_s=0.015)).burst.verdicts
    for verdicts, good, off in ((same, True, 0.0), (other, False, 0.5)):
        (exposure,) = [v for v in verdicts if v.name == "exposure_s of the reference"]
        assert (exposure.good, exposure.value) == (good, pytest.approx(off))
    assert camera.exposure_s == 0.01


def interrupted(until) -> None:
    """Ctrl-C, and time for it: the kernel may give it to another thread, and Python then runs it a little later."""
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(6000):
        if until():
            break
        time.sleep(0.01)


@pytest.fixture
def python_s_own_handler():
    """What a program starts with, whatever a test before has left."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_the_first_interrupt_asks_to_stop_and_the_second_ends(python_s_own_handler):
    with interruptible() as stopped:
        assert not stopped()
        interrupted(until=stopped)
        assert stopped()
        with pytest.raises(KeyboardInterrupt):
            interrupted(until=lambda: False)


def test_the_quality_line_says_what_is_wrong_and_what_to_do(tmp_path):
    dark = pattern(level=0.03)
    camera = SimulatedCamera(lambda: dark, seed=1)
    quality = judge_frame(camera, camera.grab())
    assert "level" in quality.line
    assert "Lengthen the exposure" in quality.line
    assert json.dumps(quality.as_json())
    write_picture(tmp_path / "now.png", camera.grab())
    assert (tmp_path / "now.png").read_bytes()[:4] == b"\x89PNG"
