"""One service with its camera, one supervisor and its workers, on one machine that may fail at any moment."""

import functools
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np

from app import worker
from app.capture.burst import Order
from app.capture.service import CaptureDesk
from app.errors import AirlensError
from app.experiment.folder import Experiment, ExperimentSettings
from app.files.toml import to_toml
from app.jobs import JobsConfig, JobSpec, Ledger, Supervisor
from app.jobs.engines.engine import Launch, ProcessState
from app.jobs.folder import JobFolder, try_lock
from app.jobs.news import News
from app.rig.live_cameras import LiveCameras
from core.geometry import Box, Optics
from core.scene import FixedTexture, Scene, View
from drivers.burst import CapturePlan
from drivers.errors import DeviceError, DeviceNotFoundError
from drivers.simulated import CameraFault, SimulatedCamera
from tests.walks.faults import Killed, Machine

CONFIG = JobsConfig(
    memory_reserve_bytes=0, disk_reserve_bytes=0, retry_first_s=1e-6, retry_longest_s=1e-5, max_losses=1000
)
JOB = JobSpec(
    kind="noise-study", settings={"trials": 2, "size_px": 32, "window_px": 16}, memory_bytes=0, disk_bytes=0
)
VIEW = np.tile(np.linspace(0.1, 0.8, 48, dtype=np.float32), (32, 1))
REFUSED = (AirlensError, DeviceError, OSError)


def scene() -> Scene:
    optics = Optics(
        position_m=(0.0, -3.0, 0.0),
        rotation_rad=(0.0, 0.0, 0.0),
        width_px=48,
        height_px=32,
        focal_px=(60.0, 60.0),
        principal_px=(23.5, 15.5),
    )
    room = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))
    return Scene(room=room, views=(View(camera=optics),), light=FixedTexture())


SETTINGS = ExperimentSettings(scene=scene())


@functools.cache
def settings_text() -> str:
    return to_toml(SETTINGS)


class Here:
    """An engine whose workers are the real ones, run in this process when `work` lets them."""

    name = "here"

    def __init__(self) -> None:
        self.alive: dict[str, tuple[Launch, object, threading.Event]] = {}

    def probe(self) -> None: ...

    def start(self, launch: Launch) -> str:
        lock = try_lock(JobFolder(launch.folder).attempt(launch.attempt) / "worker.lock")
        assert lock is not None, "two workers at once"
        self.alive[launch.name] = (launch, lock, threading.Event())
        return launch.name

    def find(self, launch: Launch) -> str | None:
        return launch.name if launch.name in self.alive else None

    def state(self, handle: str) -> ProcessState:
        return ProcessState.running if handle in self.alive else ProcessState.gone

    def exit_status(self, handle: str) -> int | None:
        return None

    def stop(self, handle: str, *, kill: bool = False) -> None:
        if handle in self.alive and kill:
            self.end(handle)
        elif handle in self.alive:
            self.alive[handle][2].set()

    def close(self) -> None: ...

    def end(self, handle: str) -> None:
        """The process is gone, without a word."""
        self.alive.pop(handle)[1].close()  # type: ignore[attr-defined]

    def work(self) -> None:
        """Let the oldest worker run to its end."""
        for handle, (launch, _, stop) in list(self.alive.items())[:1]:
            folder = JobFolder(launch.folder)
            try:
                owner = folder.owner()
                if owner.attempt == launch.attempt:
                    worker._attempt(folder, owner, stop)
            except (OSError, ValueError, Killed):
                pass  # a process that dies of it
            finally:
                self.end(handle)


class World:
    """The real objects of a service and a supervisor; `again` starts both anew after a kill."""

    def __init__(self, root: Path) -> None:
        self.root, self.machine, self.engine = root, Machine(root), Here()
        self.plugged = True
        self.experiment = self.make_experiment()
        self.begin()

    def make_experiment(self) -> Experiment:
        folder = self.root / "experiment"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        # The same text each time: to format it costs more than a walk.
        (folder / "experiment.toml").write_text(settings_text())
        return Experiment(folder, SETTINGS)

    def begin(self) -> None:
        self.ledger = Ledger(self.root / "jobs")
        self.supervisor = Supervisor(self.ledger, CONFIG, self.engine)
        cameras = LiveCameras(News(self.ledger).tell)
        self.live = cameras.first
        self.desk = CaptureDesk(
            cameras, News(self.ledger).tell, lambda experiment, air, view, moment: self.camera()
        )

    def again(self) -> None:
        """Both processes were killed: nothing of them is left but what is on the disk."""
        self.machine.dead = True
        self.finish_capture()
        self.live._tell = lambda kind, body: None  # a dead process tells nothing
        self.live.give_up("killed")
        self.ledger.close()
        self.machine.dead, self.machine.kill_in = False, None
        trouble, self.machine.trouble = self.machine.trouble, None  # a service starts on a sound disk
        self.begin()
        self.machine.trouble = trouble

    def camera(self) -> SimulatedCamera:
        if not self.plugged:
            raise DeviceNotFoundError("There is no camera. Plug it in.")
        return SimulatedCamera(lambda: VIEW, seed=1, faults=self._faults)

    def _faults(self, number: int) -> CameraFault | None:
        if self.machine.dead:
            raise Killed
        return None if self.plugged else CameraFault.UNPLUG

    def start_capture(self, frames: int = 2) -> str:
        plan = CapturePlan(role="reference", frames=frames, settle_frames=0)
        return self.desk.start(self.experiment, Order(plan)).capture or ""

    def finish_capture(self) -> None:
        self.desk.wait(60.0)

    def attempt(self, act: Callable[[], object]) -> object:
        """Do something as a request does: a refusal is an answer, a kill ends the processes."""
        try:
            return act()
        except REFUSED as refusal:
            return refusal
        except Killed:
            self.again()
            return None
        finally:
            if self.machine.dead:
                self.again()
