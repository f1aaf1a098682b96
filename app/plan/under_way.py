"""A run under way: its seconds by stage, and how long yet, corrected as it goes."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime

import psutil

from app.files.compilation_cache import compiled_folder
from app.plan.compiling import Compiled, Compiling, compiling
from app.plan.promise import STAGES, Promise, Task, in_words, promise
from app.plan.runs import Run, keep_run
from core.watch import Growing, Row, Watch

Clock = Callable[[], float]


def process_age_s() -> float:
    """Seconds since this process began; to be asked where it serves one run alone."""
    return max(0.0, time.time() - psutil.Process().create_time())


class UnderWay:
    """Follows a run through its stages; the time left is told once the task is known."""

    def __init__(
        self, start_s: float | None = None, heard: Compiling | None = None, clock: Clock = time.perf_counter
    ) -> None:
        self._heard, self._clock = heard or compiling(), clock
        self._began = self._heard.so_far
        self._ended: dict[str, float] = {} if start_s is None else {"start": start_s}
        self._stage, self._entered_s, self._entered = "read", clock(), self._began
        self._task: Task | None = None
        self._promise: Promise | None = None
        self._share = 0.0
        self._lock = threading.Lock()

    def begin(self, task: Task, *, afresh: bool) -> None:
        """What is to be done is known. How long it takes is not where it goes on from what an earlier run did."""
        if afresh:
            self._task, self._promise = task, promise(task)

    @property
    def promised_s(self) -> float | None:
        """The whole run as it was promised; without the process' start where that is not known."""
        if self._promise is None or self._promise.wall_s is None:
            return None
        return self._promise.wall_s - (
            0.0 if "start" in self._ended else self._promise.stages["start"] or 0.0
        )

    @property
    def said(self) -> str:
        """The promise, less what is over, as a sentence; empty without a task."""
        if self._promise is None:
            return ""
        if self.left_s is None:
            return "How long it takes is not known before; a plan tells: airlens plan."
        whose = "usual on this machine" if self._promise.runs else "the first of this preset on this machine"
        return f"About {in_words(self.left_s)} ({whose}{'' if self._promise.warm else '; with compiling'})."

    def keep(self) -> None:
        """The run is over: promises are learned from it."""
        if self._task is not None:
            keep_run(self._run(self._task))

    def enter(self, stage: str) -> None:
        """The stage before has ended."""
        with self._lock:
            self._ended = self._with_the_present()
            self._stage, self._entered_s, self._entered = stage, self._clock(), self._heard.so_far
            self._share = 0.0

    def watched(self, watch: Watch) -> Watch:
        """The same watch, that is told with every row how long yet (`left_s`), where that is known."""

        def on_row(row: Row, growing: Growing | None) -> None:
            self._note(row)
            left_s = self.left_s
            watch.on_row(row if left_s is None else {**row, "left_s": left_s}, growing)

        return replace(watch, on_row=on_row)

    @property
    def left_s(self) -> float | None:
        """Seconds until the end, by the promise and by how fast the present stage goes; None without a promise."""
        if self._promise is None or self._promise.wall_s is None:
            return None
        with self._lock:
            stages, share = dict(self._promise.stages), self._share
            spent_s = self._ended.get(self._stage, 0.0) + self._present_s()
            compiled_s = self._heard.so_far.since(self._began).seconds
        present = STAGES.index(self._stage)
        later = sum(stages[stage] or 0.0 for stage in STAGES[present + 1 :] if stage != "compile")
        compile_s = max(0.0, (stages["compile"] or 0.0) - compiled_s) if self._stage != "report" else 0.0
        return corrected_s(stages[self._stage] or 0.0, spent_s, share) + (1 - share) * compile_s + later

    def _run(self, task: Task) -> Run:
        with self._lock:
            ended, compiled = self._with_the_present(), self._compiled()
        folder = compiled_folder()
        seconds = ended if compiled.is_warm is None else {**ended, "compile": compiled.seconds}
        return Run(
            at=datetime.now(UTC).isoformat(timespec="seconds"),
            preset=task.preset,
            programs=task.programs,
            scene=task.scene,
            folder="" if folder is None else str(folder),
            warm=compiled.is_warm,
            pixels=task.pixels,
            work=task.work,
            seconds={stage: round(seconds[stage], 3) for stage in STAGES if stage in seconds},
        )

    def _note(self, row: Mapping[str, float | str]) -> None:
        share = row.get("share")
        if isinstance(share, float):
            self._share = min(max(share, 0.0), 1.0)

    def _compiled(self) -> Compiled:
        return self._heard.so_far.since(self._began)

    def _present_s(self) -> float:
        """Seconds of the present stage, but for those spent compiling."""
        compiled_s = self._heard.so_far.since(self._entered).seconds
        return max(0.0, self._clock() - self._entered_s - compiled_s)

    def _with_the_present(self) -> dict[str, float]:
        return {**self._ended, self._stage: self._ended.get(self._stage, 0.0) + self._present_s()}


def corrected_s(promised_s: float, spent_s: float, share: float) -> float:
    """Seconds yet of a stage of which a share is done.

    The whole is told by the promise and by the pace so far, spent / share, which counts by the share that it has
    seen. Where no share is told the promise counts down.
    """
    if share <= 0.0:
        return max(0.0, promised_s - spent_s)
    whole_s = (1 - share) * promised_s + share * (spent_s / share)
    return (1 - share) * whole_s
