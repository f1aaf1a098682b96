"""Faults of every kind at random moments, and a judge who knows what really happened."""

import time
from collections import Counter

import numpy as np

from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.errors import DeviceError, DeviceNotFoundError, DeviceRefusedError
from drivers.projector.protocol import PowerState
from drivers.simulated import CameraFault, SimulatedCamera, VirtualClock
from drivers.simulated.projector.engine import ProjectorFault
from tests.drivers.projector.twins import DIALECTS, make_link
from tests.drivers.scenes import pattern


class Storm:
    """Counts faults that were met, calls, errors by class, wrong results, and the longest call [s]."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.faults, self.errors, self.wrong = Counter(), Counter(), []
        self.calls, self.good, self.longest_s = 0, 0, 0.0

    def draw(self, kinds, rate):
        if self.random.random() >= rate:
            return None
        kind = kinds[int(self.random.integers(len(kinds)))]
        self.faults[f"{type(kind).__name__}.{kind.name}"] += 1
        return kind

    def call(self, clock, action):
        """Return the result, or None after a foreseen error; any other exception ends the storm."""
        self.calls += 1
        simulated_s, real_s = clock.now_s(), time.monotonic()
        try:
            return action()
        except DeviceError as error:
            self.errors[type(error).__name__] += 1
            return error
        finally:
            spent_s = max(clock.now_s() - simulated_s, time.monotonic() - real_s)
            self.longest_s = max(self.longest_s, spent_s)

    def counts(self):
        return {
            "faults": self.faults.total(),
            "by_kind": dict(sorted(self.faults.items())),
            "calls": self.calls,
            "good": self.good,
            "errors": dict(self.errors),
            "wrong": self.wrong,
            "longest_s": round(self.longest_s, 2),
        }


def camera_storm(storm, faults, rate=0.2):
    """Grab, follow and reconnect until so many faults were met; good frames are compared with the truth."""
    clock, view = VirtualClock(), pattern(16, 24)
    goal = storm.faults.total() + faults
    memory = {}

    def script(index):
        if index not in memory:
            memory[index] = storm.draw(list(CameraFault), rate)
        return memory[index]

    camera = SimulatedCamera(lambda: view, seed=7, clock=clock, faults=script)
    last_s = float("-inf")
    while storm.faults.total() < goal:
        called_s = clock.now_s()
        fresh = storm.random.random() < 0.3
        clock.advance_s(float(storm.random.random() < 0.05) * 0.4)
        frame = storm.call(clock, camera.grab if fresh else camera.follow)
        if isinstance(frame, DeviceNotFoundError):
            camera.reconnect()
            memory.clear()
            last_s = float("-inf")
            continue
        if isinstance(frame, DeviceError):
            continue
        index = round((frame.timestamp_s - camera._started_s) / camera._period_s)
        exact = np.array_equal(frame.pixels, camera.expected(index))
        if not exact or frame.timestamp_s <= last_s or (fresh and frame.timestamp_s < called_s - 1e-6):
            storm.wrong.append(f"frame {frame.sequence}")
        last_s = frame.timestamp_s
        storm.good += 1


def burst_storm(storm, faults, rate=0.1):
    """Take bursts until so many faults were met; each mean must be that of the true frames it names."""
    goal = storm.faults.total() + faults
    kinds = [kind for kind in CameraFault if kind is not CameraFault.UNPLUG]
    while storm.faults.total() < goal:
        clock, view, memory = VirtualClock(), pattern(16, 24), {}

        def script(index, memory=memory):
            return memory.setdefault(index, storm.draw(kinds, rate))

        camera = SimulatedCamera(lambda view=view: view, seed=9, clock=clock, faults=script)
        plan = CapturePlan(frames=30, settle_frames=0)
        burst = run_capture(camera, plan, clock=clock)
        storm.calls += 1
        truth = [camera.expected(round(r.timestamp_s / camera._period_s)) for r in burst.records]
        mean = np.mean(truth, axis=0) / burst.full_scale_counts
        if not np.allclose(burst.mean, mean, rtol=1e-5) or burst.frames != 30:
            storm.wrong.append("burst")
        storm.good += burst.frames


def projector_storm(storm, name, faults, rate=0.25):
    """Ask and command until so many faults were met; what is said and done is compared with the twin."""
    goal = storm.faults.total() + faults
    link, twin, clock = make_link(name, lambda _: storm.draw(list(ProjectorFault), rate), seed=3)
    state = twin.responder.state
    while storm.faults.total() < goal:
        clock.advance_s(float(storm.random.choice([0.0, 1.0, 8.0, 60.0])))
        choice = int(storm.random.integers(6))
        on = bool(storm.random.integers(2))
        before = state.power
        if choice == 0:
            result = storm.call(clock, link.power)
            _judge_power(storm, name, result, {before, state.power})
        elif choice == 1:
            result = storm.call(clock, link.status)
            _judge_status(storm, name, result, state, {before, state.power})
        elif choice == 2:
            storm.call(clock, link.turn_on if on else link.turn_off)
        elif choice == 3:
            done = storm.call(clock, lambda on=on: link.mute(on))
            _judge_set(storm, name, done, state.muted == on)
        elif choice == 4:
            done = storm.call(clock, lambda on=on: link.freeze(on))
            _judge_set(storm, name, done, state.frozen == on)
        else:
            code = DIALECTS[name][2][int(on)]
            done = storm.call(clock, lambda code=code: link.select_source(code))
            _judge_set(storm, name, done, state.source == code)


def _judge_power(storm, name, said, true):
    if isinstance(said, DeviceError):
        return
    # While a switch is under way, "still warming" and "still cooling" are the careful answers.
    allowed = true | {PowerState.SILENT, PowerState.WARMING, PowerState.COOLING}
    if name in ("nec", "optoma"):  # they have no word for it
        allowed |= {PowerState.ON} if PowerState.WARMING in true else set()
        allowed |= {PowerState.STANDBY} if PowerState.COOLING in true else set()
    if said not in allowed:
        storm.wrong.append(f"{name} said {said}, was {true}")
    storm.good += 1


def _judge_status(storm, name, status, state, true):
    if isinstance(status, DeviceError):
        return
    _judge_power(storm, name, status.power, true)
    facts = {"muted": state.muted, "frozen": state.frozen, "lamp_hours": state.lamp_hours, "name": state.name}
    for key, fact in facts.items():
        if getattr(status, key) not in (None, fact):
            storm.wrong.append(f"{name} {key} {getattr(status, key)!r} is {fact!r}")


def _judge_set(storm, name, done, true):
    if isinstance(done, DeviceRefusedError | DeviceError):
        return
    if not true:
        storm.wrong.append(f"{name}: a command was said to be done and was not")
    storm.good += 1


def whole_storm(faults, seed=0):
    """A quarter of the faults each for frames and bursts, the rest over the dialects."""
    storm = Storm(seed)
    camera_storm(storm, faults // 4)
    burst_storm(storm, faults // 4)
    for number, name in enumerate(sorted(DIALECTS)):
        left = faults - storm.faults.total()
        projector_storm(storm, name, -(-left // (len(DIALECTS) - number)))
    return storm
