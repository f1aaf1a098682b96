"""A walk of a service through its states, with faults at every step: no state without a way out, nothing lost."""

import collections
import errno
import shutil
import tempfile
from pathlib import Path

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from app.capture.service import CAPTURE, CaptureEvent, DeskState
from app.experiment.captures import load_capture
from app.jobs import JobState
from app.jobs.folder import JobFolder
from app.jobs.state import JOB as JOB_TABLE
from app.rig.live_camera import CAMERA, CameraEvent, CameraState
from tests.walks.world import JOB, REFUSED, World

DAYS_S = 172_800.0
SHM = Path("/dev/shm")
TALLY: collections.Counter[str] = collections.Counter()
AFTER_TRIES = 3


class Walk(RuleBasedStateMachine):
    """Each rule is one step. `jobs`, `begun` and `finished` are what was acknowledged."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory(dir=SHM if SHM.is_dir() else None)
        self.world = World(Path(self._folder.name).resolve())
        self._machine = self.world.machine.installed()
        self._machine.__enter__()
        self.jobs: list[str] = []
        self.deleted: set[str] = set()
        self.cancelled: set[str] = set()
        self.begun: str | None = None
        self.finished: set[str] = set()

    def _do(self, name: str, act) -> object:
        TALLY[name] += 1
        self._settle()
        answer = self.world.attempt(act)
        TALLY["refusals"] += isinstance(answer, REFUSED)
        return answer

    def _settle(self) -> None:
        """Note how the last capture ended."""
        status = self.world.desk.status
        if status.state is DeskState.finished and status.capture and status.capture == self.begun:
            self.finished.add(status.capture)
            self.begun = None

    # The operator

    @rule()
    def submit(self) -> None:
        job = self._do("submit", lambda: self.world.ledger.submit(JOB).id)
        if isinstance(job, str):
            self.jobs.append(job)

    @rule(n=st.integers(0, 5), word=st.sampled_from(["cancel", "pause", "resume", "retry"]))
    def ask(self, n: int, word: str) -> None:
        if self.jobs:
            job = self.jobs[n % len(self.jobs)]
            answer = self._do(word, lambda: getattr(self.world.ledger, word)(job).state)
            if answer is JobState.cancelled:
                self.cancelled.add(job)
            elif answer is JobState.queued:
                self.cancelled.discard(job)

    @rule(frames=st.integers(1, 3), wait=st.booleans())
    def capture(self, frames: int, wait: bool) -> None:
        answer = self._do("capture", lambda: self.world.start_capture(frames))
        if isinstance(answer, str):
            self.begun = answer
        if wait:
            self._do("wait", self.world.finish_capture)

    @rule(discard=st.booleans())
    def abort(self, discard: bool) -> None:
        self._do("abort", lambda: self.world.desk.abort(discard))
        assert self.world.desk.status.state is not DeskState.running

    @rule()
    def connect(self) -> None:
        self._do("connect", lambda: self.world.live.open("experiment", self.world.camera))

    @rule()
    def disconnect(self) -> None:
        self._do("disconnect", self.world.live.close)

    @rule(exposure_s=st.sampled_from([0.001, 0.01, 100.0]))
    def expose(self, exposure_s: float) -> None:
        self._do("expose", lambda: self.world.live.set(exposure_s, None))

    # What goes on by itself

    @rule()
    def look(self) -> None:
        self._do("round", self.world.supervisor.round)

    @rule()
    def work(self) -> None:
        self._do("work", self.world.engine.work)

    # Faults

    @rule(trouble=st.sampled_from([errno.ENOSPC, errno.EROFS, None]))
    def disk(self, trouble: int | None) -> None:
        TALLY[f"disk {errno.errorcode.get(trouble or 0, 'sound')}"] += 1
        self.world.machine.trouble = trouble

    @rule(jump_s=st.sampled_from([-DAYS_S, DAYS_S]))
    def jump(self, jump_s: float) -> None:
        TALLY["clock jump"] += 1
        self.world.machine.clock_s += jump_s

    @rule()
    def unplug(self) -> None:
        TALLY["unplug"] += 1
        self.world.plugged = not self.world.plugged

    @rule()
    def kill_worker(self) -> None:
        TALLY["kill worker"] += 1
        for handle in list(self.world.engine.alive)[:1]:
            self.world.engine.end(handle)

    @rule(writes=st.integers(0, 12))
    def kill_soon(self, writes: int) -> None:
        """The service and the supervisor are killed after so many more changes of the disk."""
        TALLY["kill after writes"] += 1
        self.world.machine.kill_in = writes

    @rule()
    def kill(self) -> None:
        TALLY["kill"] += 1
        self.world.again()

    @rule(n=st.integers(0, 5))
    def delete_job(self, n: int) -> None:
        if self.jobs:
            TALLY["delete job"] += 1
            job = self.jobs[n % len(self.jobs)]
            self._behind(self.world.ledger.folder / job)
            self.deleted.add(job)

    @rule()
    def delete_experiment(self) -> None:
        TALLY["delete experiment"] += 1
        self._settle()
        self.finished.clear()
        self.begun = None
        self._behind(self.world.root / "experiment")

    def _behind(self, folder: Path) -> None:
        """Delete a folder behind the program's back, whatever its disk is like."""
        with self.world.machine.behind():
            shutil.rmtree(folder, ignore_errors=True)

    # What must hold

    @invariant()
    def nothing_that_was_acknowledged_is_lost(self) -> None:
        known = {job.id: job for job in self.world.ledger.jobs()}
        assert known.keys() >= set(self.jobs)
        for job in known.values():
            if job.id in self.cancelled:
                assert job.state is JobState.cancelled
            if job.state is JobState.done and job.id not in self.deleted:
                assert JobFolder(self.world.ledger.folder / job.id).is_published()
        for name in self.finished:
            assert load_capture(self.world.experiment.captures_folder / name).complete

    @invariant()
    def every_state_is_of_the_tables_and_has_a_way_out(self) -> None:
        desk, camera = self.world.desk.status.state, self.world.live.status.state
        assert CAPTURE.reachable(desk) >= {DeskState.running, DeskState.finished}
        assert CAMERA.reachable(camera) >= {CameraState.ready, CameraState.closed}

    def teardown(self) -> None:
        try:
            self._faults_end()
            self._a_capture_is_taken()
            self._a_camera_is_opened()
            self._every_job_ends()
            self.nothing_that_was_acknowledged_is_lost()
            TALLY["walks"] += 1
        finally:
            self._machine.__exit__(None, None, None)
            self.world.desk.close()
            self.world.live.give_up("the walk is over")
            self.world.ledger.close()
            self._folder.cleanup()

    def _faults_end(self) -> None:
        world = self.world
        world.finish_capture()
        world.machine.kill_in, world.machine.trouble, world.plugged = None, None, True
        if world.machine.dead:
            world.again()
        if not (world.root / "experiment" / "experiment.toml").exists():
            world.experiment = world.make_experiment()

    def _a_capture_is_taken(self) -> None:
        for _ in range(AFTER_TRIES):
            self.world.desk.abort(False)
            name = self.world.start_capture()
            self.world.finish_capture()
            if self.world.desk.status.state is DeskState.finished:
                assert self.world.experiment.latest_capture("reference").name == name
                return
        raise AssertionError(f"no capture in {AFTER_TRIES} tries: {self.world.desk.status}")

    def _a_camera_is_opened(self) -> None:
        self.world.live.close()
        assert self.world.live.open("experiment", self.world.camera).state is CameraState.ready
        assert CAMERA.allows(self.world.live.status.state, CameraEvent.take)
        assert CAPTURE.allows(self.world.desk.status.state, CaptureEvent.start)

    def _every_job_ends(self) -> None:
        ledger, newest = self.world.ledger, self.world.ledger.submit(JOB).id
        for _ in range(6 * len(ledger.jobs()) + 6):
            self.world.supervisor.round()
            self.world.engine.work()
        for job in ledger.jobs():
            paused = job.state is JobState.paused
            assert paused or job.state.is_finished, f"{job.state}: {job.reason}"
            assert job.state is JobState.done or JOB_TABLE.reachable(job.state) >= {JobState.done}
        assert ledger.get(newest).state is JobState.done
