"""The cameras of one capture, in turn or at once: one that fails keeps none of the others from their bursts."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial

from app.capture.start_together import StartTogether
from app.capture.watched import BurstWatch, run_watched
from app.errors import AirlensError
from app.experiment.folder import Experiment
from app.experiment.views import opened_for, view_names
from app.rig.conditions import Conditions, seconds_on
from app.rig.lamps import Lamps
from drivers.burst import Burst, BurstOutcome, CapturePlan, Progress
from drivers.capture import OnFrame, Taken
from drivers.errors import DeviceError
from drivers.protocols import Camera

# Opens the camera of a view, by its number.
OpensView = Callable[[int], AbstractContextManager[Camera]]
_FAILURES = (AirlensError, DeviceError, OSError)


@dataclass(frozen=True)
class ViewBursts:
    """The bursts by the view's number, and by its name why nothing whole came of it; `errors` as they were raised.

    `apart_s` is how far apart in time frames of the same number reached this machine, at most, over all cameras.
    """

    bursts: Mapping[int, Burst]
    failed: Mapping[str, str]
    errors: tuple[Exception, ...] = field(default=(), repr=False)
    apart_s: float | None = None


@dataclass
class ViewCapture:
    """A capture of all views by `camera`, which is open and the first one's, and by those that `opens` opens.

    `keep` gets the frames of the first. Before each turn `lamps` lights the wall by that view's projector.
    """

    experiment: Experiment
    camera: Camera
    opens: OpensView
    plan: CapturePlan
    told: Conditions
    watch: BurstWatch
    keep: OnFrame
    lamps: Lamps | None = None

    def __post_init__(self) -> None:
        self._lamps = self.lamps or Lamps(self.experiment)
        self._names = view_names(self.experiment)
        self._bursts: dict[int, Burst] = {}
        self._failed: dict[str, str] = {}
        self._errors: list[Exception] = []
        self._arrived_s: dict[int, list[float]] = {}
        self._progress: dict[int, Progress] = {}
        self._lock = threading.Lock()

    def in_turn(self) -> ViewBursts:
        """One burst after the other; each camera is opened when its turn has come. An abort ends them all."""
        with self._caught(0):
            self._lamps.light(0)
            self._take(0, self.camera, self.watch)
        for number in range(1, len(self._names)):
            if any(burst.outcome is BurstOutcome.ABORTED for burst in self._bursts.values()):
                self._failed[self._names[number]] = "the capture was stopped before its turn"
                continue
            with self._caught(number), self._alone(number) as own:
                self._lamps.light(number)
                self._take(number, own, self.watch)
        return self._found()

    def at_once(self) -> ViewBursts:
        """All bursts at the same time, a thread each: their frames begin when the last camera has settled."""
        with ExitStack() as stack:
            cameras = {0: self.camera}
            for number in range(1, len(self._names)):
                with self._caught(number):
                    cameras[number] = stack.enter_context(self.opens(number))
            start = StartTogether(len(cameras), lambda: self.watch.stop() is not None)
            with ThreadPoolExecutor(len(cameras), "capture-view") as threads:
                under_way = [
                    threads.submit(self._beside, number, camera, start) for number, camera in cameras.items()
                ]
            for one in under_way:
                one.result()  # what nobody thought of is raised
        return self._found()

    def _beside(self, number: int, camera: Camera, start: StartTogether) -> None:
        """One of the bursts at the same time; whoever watches hears of the one that is last."""
        settled: list[bool] = []

        def ready() -> None:
            settled.append(True)
            start.ready()

        watch = replace(self.watch, progress=partial(self._slowest, number), frame=self._alone_shown)
        try:
            self._take(number, camera, watch, ready)
        finally:
            if not settled:
                start.gone()
            with self._lock:
                self._progress.pop(number, None)

    def _take(
        self, number: int, camera: Camera, watch: BurstWatch, ready: Callable[[], object] | None = None
    ) -> None:
        arrived_s = self._arrived_s.setdefault(number, [])

        def keep(taken: Taken) -> None:
            arrived_s.append(time.monotonic())
            if number == 0:
                self.keep(taken)

        seconds = seconds_on(self.experiment.settings, self.told)
        with self._caught(number):
            burst = run_watched(camera, self.plan, watch, keep, seconds, number, ready)
            self._bursts[number] = burst
            if burst.outcome is not BurstOutcome.COMPLETE:
                name = self._names[number]
                ended = f"{burst.outcome.value} after {burst.frames} of {self.plan.frames} frames"
                self._failed[name] = f"{ended}. {burst.outcome.advice}".rstrip()

    @contextmanager
    def _caught(self, number: int) -> Iterator[None]:
        """Note what goes wrong with a camera, and go on."""
        try:
            yield
        except _FAILURES as error:
            self._failed[self._names[number]] = str(error)
            self._errors.append(error)

    @contextmanager
    def _alone(self, number: int) -> Iterator[Camera]:
        """The camera of a view; where it cannot be opened beside the first one, that one rests meanwhile."""
        if opened_for(self.experiment, number) == 0:
            yield self.camera
            return
        with ExitStack() as stack:
            try:
                own = stack.enter_context(self.opens(number))
            except DeviceError:
                self.camera.close()
                stack.callback(self.camera.reconnect)
                own = stack.enter_context(self.opens(number))
            yield own

    def _slowest(self, number: int, progress: Progress) -> None:
        if self.watch.progress is None:
            return
        with self._lock:
            self._progress[number] = progress
            told = self._progress.values()
            done, refused = min(one.done for one in told), sum(one.refused for one in told)
            self.watch.progress(replace(progress, done=done, refused=refused))

    def _alone_shown(self, taken: Taken, view: int) -> None:
        if self.watch.frame is not None:
            with self._lock:
                self.watch.frame(taken, view)

    def _found(self) -> ViewBursts:
        """In the order of the views, whichever ended first."""
        bursts = {number: self._bursts[number] for number in sorted(self._bursts)}
        whole = [self._arrived_s[number] for number, burst in bursts.items() if burst.frames]
        same = list(zip(*whole, strict=False)) if len(whole) > 1 else []
        apart_s = max((max(times) - min(times) for times in same), default=None)
        failed = {name: self._failed[name] for name in self._names if name in self._failed}
        return ViewBursts(bursts, failed, tuple(self._errors), apart_s)


def together(bursts: Mapping[int, Burst], names: tuple[str, ...]) -> Burst:
    """The burst that stands for those of all views: one that ended early, else the first.

    It has the verdicts and the refused frames of all.
    """
    verdicts = [
        replace(verdict, name=f"{names[number]}: {verdict.name}")
        for number, burst in bursts.items()
        for verdict in burst.verdicts
    ]
    short = [burst for burst in bursts.values() if burst.outcome is not BurstOutcome.COMPLETE]
    refused: Counter[str] = Counter()
    for burst in bursts.values():
        refused.update(burst.refused)
    return replace([*short, *bursts.values()][0], verdicts=tuple(verdicts), refused=dict(refused))
