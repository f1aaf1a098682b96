"""`airlens calibrate STEP EXPERIMENT` without pictures: the rig takes them, the operator is told what to show."""

import contextlib
import select
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import typer

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.calibrate.pictures import CalibrationStoppedError
from app.calibrate.state import line_of
from app.calibrate.together_live import TogetherPlan, TogetherSession, opened
from app.errors import BadInputError
from app.experiment.folder import Experiment, open_experiment
from app.experiment.views import view_number
from app.rig.screens import open_screen
from app.rig.stage import StageTask
from drivers.display import PatternDisplay

# A wanted view that did not come out so often is left out, where nobody is there to decide.
TRIES = 3


@dataclass(frozen=True)
class LiveOptions:
    """What only a live calibration asks: `every_s` takes a picture by the clock, for hands that hold a board."""

    every_s: float | None = None
    screen: str = "kiosk"
    port: int = 8766
    retake: tuple[str, ...] = ()


def run_live(folder: Path, plan: LivePlan, options: LiveOptions) -> None:
    """Guide through one step on the experiment's rig. Ctrl-C keeps what there is; the same command goes on."""
    from app.capture.burst import interruptible
    from app.rig.lamps import Lamps
    from app.rig.open import open_stage

    experiment = open_experiment(folder)
    calibration = CalibrationFolder(folder)
    view = view_number(experiment, plan.camera)
    with _screen(experiment, options, view) as display, interruptible() as stopped:
        if display is not None:
            Lamps(experiment).light(view)
        stage = open_stage(experiment, plan.board, display, view)
        with stage.camera:
            guided = GuidedCalibration(calibration, plan, stage)
            guided.resume()
            for name in options.retake:
                guided.retake(name)
            _session(
                calibration,
                guided,
                plan.step,
                Prompt(stage.arranges_itself, options.every_s, stopped),
                stopped,
            )
            guided.finish()


def _session(
    calibration: CalibrationFolder,
    guided: GuidedCalibration,
    step: StepName,
    prompt: "Prompt",
    stopped: Callable[[], bool],
) -> None:
    tries: dict[StageTask, int] = {}
    while (task := guided.wanted()) is not None and not stopped():
        if not prompt.ready(task, guided):
            continue
        try:
            issues = guided.take(_tell, stopped)
        except CalibrationStoppedError as stop:
            typer.echo(str(stop), err=True)
            return
        for issue in issues:
            typer.echo(f"- {issue}", err=True)
        if step in (StepName.camera, StepName.projector):
            typer.echo(line_of(calibration, guided.record, step), err=True)
        tries[task] = tries.get(task, 0) + 1
        if tries[task] >= TRIES and not prompt.attended and guided.wanted() == task:
            typer.echo(f"Left out after {TRIES} tries: {task.text}", err=True)
            guided.skip()


def run_together(calibration: CalibrationFolder, plan: TogetherPlan, options: LiveOptions) -> tuple[str, ...]:
    """Guide through places of a board that several cameras see; returns what is wrong with the pictures.

    Ctrl-C keeps what there is; the same command goes on.
    """
    from app.capture.burst import interruptible

    issues: list[str] = []
    with interruptible() as stopped, opened(open_experiment(calibration.experiment), plan.board) as stages:
        session = TogetherSession(calibration, plan, stages)
        issues += session.resume()
        for name in options.retake:
            session.retake(name)
        prompt = Prompt(session.arranges_itself, options.every_s, stopped)
        while (task := session.wanted()) is not None and not stopped():
            if not prompt.ready(task, session):
                continue
            try:
                found = session.take(stopped)
            except CalibrationStoppedError as stop:
                typer.echo(str(stop), err=True)
                break
            issues += found
            for issue in found:
                typer.echo(f"- {issue}", err=True)
            typer.echo(f"{session.places} of {plan.places} places seen by several cameras", err=True)
    return tuple(issues)


class Guided(Protocol):
    """What asks for one thing after another."""

    def skip(self) -> None:
        """Do without what is wanted now."""
        ...

    def retake(self, name: str) -> object:
        """Forget what was taken under a name. Raises BadInputError."""
        ...


class Prompt:
    """Says what to arrange, then waits for Enter, for the clock, or not at all (a simulated rig)."""

    def __init__(self, simulated: bool, every_s: float | None, stopped: Callable[[], bool]) -> None:
        self._simulated, self._every_s, self._stopped = simulated, every_s, stopped
        self.attended = not simulated and every_s is None

    def ready(self, task: StageTask, guided: "Guided") -> bool:
        """Whether to take the picture now; False after a skip, a retake, or the end."""
        typer.echo(task.text, err=True)
        if self._simulated:
            return True
        if self._every_s is not None:
            return self._wait(self._every_s)
        typer.echo("[Enter: take it; s: skip; r NAME: retake; q: stop] ", nl=False, err=True)
        answer = self._line()
        if answer in ("s", "skip"):
            guided.skip()
        elif answer.startswith("r "):
            with contextlib.suppress(BadInputError):
                guided.retake(answer[2:].strip())
        return answer == ""

    def _wait(self, seconds: float) -> bool:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s and not self._stopped():
            time.sleep(0.05)
        return not self._stopped()

    def _line(self) -> str:
        """A line from the keyboard; "q" raises as Ctrl-C does, which ends without waiting for Enter."""
        while not self._stopped():
            if select.select([sys.stdin], [], [], 0.1)[0]:
                line = sys.stdin.readline()
                if line and line.strip() not in ("q", "quit"):
                    return line.strip()
                raise typer.Exit(0)
        return "q"


@contextlib.contextmanager
def _screen(experiment: Experiment, options: LiveOptions, view: int) -> Iterator[PatternDisplay | None]:
    """The real projector's screen, where the step needs one and the rig has it."""
    from app.rig.open import panel_of

    simulated = experiment.settings.rig.camera_kind == "simulated"
    if simulated or panel_of(experiment.settings.scene, view) is None:
        yield None
        return
    with open_screen(options.screen, options.port, lambda text: typer.echo(text, err=True)) as display:
        yield display


def _tell(done: int, total: int) -> None:
    if sys.stderr.isatty():
        typer.echo(f"\r{done} of {total} pictures", nl=done == total, err=True)
