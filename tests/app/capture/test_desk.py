"""The capture desk on a disk that fails, with a camera that hangs, and after a kill: it can always go on."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.capture import service
from app.capture.burst import Order
from app.capture.service import CAPTURE, CaptureDesk, CaptureEvent, DeskState
from app.errors import AirlensError
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, interrupted, new_id
from app.jobs import Ledger
from app.jobs.news import News
from app.rig.live_camera import CAMERA, CameraState, LiveCamera
from app.rig.live_cameras import LiveCameras
from drivers.burst import CapturePlan
from drivers.errors import DeviceBusyError
from drivers.simulated import SimulatedCamera
from tests.walks.faults import Machine
from tests.walks.world import SETTINGS, VIEW, settings_text

LIMIT_S = 100.0


@pytest.fixture
def experiment(tmp_path: Path) -> Experiment:
    folder = tmp_path / "experiment"
    folder.mkdir()
    (folder / "experiment.toml").write_text(settings_text())
    return Experiment(folder, SETTINGS)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Machine]:
    machine = Machine(tmp_path)
    with machine.installed():
        yield machine


def order(frames: int = 2) -> Order:
    return Order(CapturePlan(role="reference", frames=frames, settle_frames=0))


def desk_of(tmp_path: Path, make: Callable[[], SimulatedCamera] | None = None) -> CaptureDesk:
    tell = News(Ledger(tmp_path / "jobs")).tell
    camera = make or (lambda: SimulatedCamera(lambda: VIEW, seed=1))
    return CaptureDesk(LiveCameras(tell), tell, lambda experiment, air, view, moment: camera())


def taken(desk: CaptureDesk, experiment: Experiment) -> DeskState:
    desk.start(experiment, order())
    return desk.wait(LIMIT_S).state


def test_a_full_disk_refuses_a_capture_and_the_next_one_is_taken(
    tmp_path: Path, experiment: Experiment, disk: Machine
):
    desk = desk_of(tmp_path)
    disk.trouble = errno.ENOSPC
    with pytest.raises(OSError, match="No space left"):
        desk.start(experiment, order())
    assert desk.status.state is DeskState.idle
    assert desk.abort(False).state is DeskState.idle
    disk.trouble = None
    assert taken(desk, experiment) is DeskState.finished


def test_a_ledger_that_is_full_delays_the_news_and_nothing_else(
    tmp_path: Path, experiment: Experiment, disk: Machine
):
    ledger = Ledger(tmp_path / "jobs")
    news = News(ledger)
    live = LiveCamera(news.tell)
    disk.trouble = errno.ENOSPC
    assert live.open("room", lambda: SimulatedCamera(lambda: VIEW, seed=1)).state is CameraState.ready
    assert live.close().state is CameraState.closed
    assert ledger.events() == []
    disk.trouble = None
    news.catch_up()
    assert [event.body["state"] for event in ledger.events()] == ["closed"]


def test_a_disk_that_fills_during_a_capture_ends_it_as_failed(
    tmp_path: Path, experiment: Experiment, disk: Machine
):
    def filling() -> SimulatedCamera:
        disk.trouble = errno.ENOSPC
        return SimulatedCamera(lambda: VIEW, seed=1)

    desk = desk_of(tmp_path, filling)
    desk.start(experiment, order())
    assert desk.wait(LIMIT_S).state is DeskState.failed
    assert "No space left" in desk.status.reason
    disk.trouble = None
    desk = desk_of(tmp_path)
    assert taken(desk, experiment) is DeskState.finished


@pytest.mark.parametrize("error", [ValueError("what nobody thought of"), MemoryError()])
def test_whatever_a_capture_raises_it_ends(tmp_path: Path, experiment: Experiment, error: Exception):
    def broken() -> SimulatedCamera:
        raise error

    desk = desk_of(tmp_path, broken)
    desk.start(experiment, order())
    assert desk.wait(LIMIT_S).state is DeskState.failed
    assert type(error).__name__ in desk.status.reason
    assert interrupted(experiment.captures_folder) == []


def test_a_camera_that_hangs_is_left_behind_by_an_abort(
    tmp_path: Path, experiment: Experiment, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(service, "ABORT_LIMIT_S", 0.2)
    reached, free, looks = threading.Event(), threading.Event(), []

    def hangs() -> np.ndarray:
        looks.append(1)
        if len(looks) == 2:  # the first is the camera's own, when it is made
            reached.set()
            free.wait(LIMIT_S)
        return VIEW

    desk = desk_of(tmp_path, lambda: SimulatedCamera(hangs, seed=1))
    try:
        desk.start(experiment, order())
        assert reached.wait(LIMIT_S)
        status = desk.abort(False)
        assert status.state is DeskState.aborted
        assert "Connect it again" in status.reason
        free.set()
        assert taken(desk, experiment) is DeskState.finished
    finally:
        free.set()


def test_a_capture_whose_experiment_was_deleted_says_so(tmp_path: Path, experiment: Experiment):
    def deleted() -> SimulatedCamera:
        shutil.rmtree(experiment.folder)
        return SimulatedCamera(lambda: VIEW, seed=1)

    desk = desk_of(tmp_path, deleted)
    desk.start(experiment, order())
    assert desk.wait(LIMIT_S).state is DeskState.failed
    assert "experiment" in desk.status.reason
    assert not experiment.folder.exists()
    with pytest.raises(AirlensError, match="Restore the experiment"):
        desk.start(experiment, order())
    assert desk.status.state is DeskState.failed


CAPTURE_FOR_EVER = """
import sys, time
from pathlib import Path
from tests.app.capture.test_desk import desk_of, order, SimulatedCamera, VIEW
from drivers.clock import SystemClock
from tests.walks.world import SETTINGS
from app.experiment.folder import Experiment
folder = Path(sys.argv[1])
def camera():
    return SimulatedCamera(lambda: VIEW, seed=1, clock=SystemClock())
print(desk_of(folder, camera).start(Experiment(folder / "experiment", SETTINGS), order(100_000)).capture, flush=True)
time.sleep(600)
"""


def test_a_capture_that_was_killed_is_listed_as_interrupted(tmp_path: Path, experiment: Experiment):
    command = [sys.executable, "-c", CAPTURE_FOR_EVER, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ)) as child:
        assert child.stdout is not None
        name = child.stdout.readline().strip()
        child.send_signal(signal.SIGKILL)
    assert name
    assert [folder.name for folder in interrupted(experiment.captures_folder)] == [name]
    assert taken(desk_of(tmp_path), experiment) is DeskState.finished


def test_names_sort_as_they_were_given_also_when_the_clock_is_set_back(
    tmp_path: Path, experiment: Experiment, disk: Machine
):
    names = []
    for jump_s in (0.0, 0.0, 172_800.0, -172_800.0, -172_800.0):
        disk.clock_s += jump_s
        names.append(new_id(tmp_path, "flow"))
        (tmp_path / names[-1]).mkdir()
    assert names == sorted(set(names))
    desk = desk_of(tmp_path)
    for _ in range(3):
        assert taken(desk, experiment) is DeskState.finished
        assert experiment.latest_capture("reference").name == desk.status.capture
    assert load_capture(experiment.latest_capture("reference")).complete


def test_what_the_tables_do_not_name_is_refused_with_a_sentence(tmp_path: Path, experiment: Experiment):
    with pytest.raises(DeviceBusyError, match="A capture is running"):
        CAPTURE.after(DeskState.running, CaptureEvent.start)
    for state in DeskState:
        assert CAPTURE.reachable(state) >= set(DeskState) - {DeskState.idle}
    for state in CameraState:
        assert CAMERA.reachable(state) == set(CameraState)
