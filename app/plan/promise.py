"""How long a run will take, as wall time by stage: its figures, times what runs on this machine took of theirs.

    promise(stage) = figure(stage) * median over the nearest runs of taken(stage) / figure(stage)

The figures: a straight line in the pixels for reading and measuring, in the work for solving; for the rest a time a
preset. They come from another machine until this one has finished a run. The nearest runs are the newest of the
same scene and preset; else of the preset; else all.
"""

import functools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from app.experiment.plan import Plan, PresetLine
from app.files.compilation_cache import compiled_folder
from app.files.toml import Strict, parse
from app.plan.machine import this_machine
from app.plan.runs import Run, kept_runs
from core.plan.speed import Speed, Work

# In their order; `compile` is what of the others is spent compiling.
STAGES = ("start", "read", "measure", "compile", "solve", "report")
FIGURES = Path(__file__).resolve().parent / "tradeoff" / "stages.json"
# A median of so few follows a machine that has changed, and is not led by one run beside another program.
_NEWEST = 5
# Presets whose stages were not measured, and which they are like: the same march, the same losses.
_LIKE = {"reference": "standard", "paper": "grid"}


@dataclass(frozen=True)
class Task:
    """A run to come: `work` in the solver's loops, None where it is not counted; `pixels` of all views.

    Equal `programs` need the same compiled programs; equal `scene`, solved by one preset, takes the same work.
    """

    preset: str
    programs: str
    scene: str
    pixels: float
    work: float | None


class Line(Strict):
    """Seconds of a stage: `fixed_s + s_per_pixel * pixels`."""

    fixed_s: float
    s_per_pixel: float


class Figures(Strict):
    """What stages took on the machine that they were measured on; `cold_s`, `warm_s` and `report_s` by preset."""

    measured: str
    start_s: float
    read: Line
    measure: Line
    cold_s: dict[str, float]
    warm_s: dict[str, float]
    report_s: dict[str, float]


@dataclass(frozen=True)
class Promise:
    """Seconds by stage, None where nothing tells; whether its programs lie compiled; runs here of this preset."""

    stages: Mapping[str, float | None]
    warm: bool
    runs: int

    @property
    def wall_s(self) -> float | None:
        """All of it, from the start of the process to the report."""
        return total(self.stages.values())

    @property
    def solver_s(self) -> float | None:
        """Compiling and solving: what a result tells as its solver's time, but for what is compiled to measure."""
        return total((self.stages["compile"], self.stages["solve"]))


def promise(
    task: Task, runs: Iterable[Run] | None = None, speeds: Mapping[str, Speed] | None = None
) -> Promise:
    """The promise for a task, by this machine's runs and figures unless others are given."""
    known = tuple(kept_runs() if runs is None else runs)
    speeds = this_machine()[0].speeds if speeds is None else speeds
    warm = is_warm(task, known)
    stages = {stage: stage_s(stage, task, warm, known, speeds) for stage in STAGES}
    return Promise(stages, warm, sum(run.preset == task.preset for run in known))


def renewed(plan: Plan) -> Plan:
    """A kept plan with the times that this machine's runs tell now."""
    runs, speeds = kept_runs(), this_machine()[0].speeds
    lines = [_renewed(line, plan, runs, speeds) for line in plan.presets]
    return plan.model_copy(update={"presets": lines, "machine": source(runs)})


def _renewed(line: PresetLine, plan: Plan, runs: tuple[Run, ...], speeds: Mapping[str, Speed]) -> PresetLine:
    """A line of a plan that was made before times were learned stays as it is."""
    if not line.fits or not line.programs:
        return line
    found = promise(Task(line.preset, line.programs, plan.scene, plan.pixels, line.work), runs, speeds)
    times = {"wall_s": found.wall_s, "solver_s": found.solver_s, "compiled": found.warm}
    return line.model_copy(update=times)


def is_warm(task: Task, runs: Iterable[Run]) -> bool:
    """Whether a run needed the same programs, and the folder that they were kept in is still there."""
    folder = compiled_folder()
    if folder is None or not any(folder.glob("*")):
        return False
    return any(run.programs == task.programs and run.folder == str(folder) for run in runs)


def stage_s(
    stage: str, task: Task, warm: bool, runs: tuple[Run, ...], speeds: Mapping[str, Speed]
) -> float | None:
    """Seconds of one stage; None where its figure is not known and the same was never done."""
    tellers = tuple(run for run in runs if stage in run.seconds and (stage != "compile" or run.warm is warm))
    said_s = figure_s(stage, task, warm, speeds)
    if said_s is None:
        same = [run.seconds[stage] for run in tellers if _alike(run, task)]
        return median(same[-_NEWEST:]) if same else None
    ratios = [
        run.seconds[stage] / told_s
        for run in _nearest(task, tellers)
        if (told_s := figure_s(stage, run, warm, speeds))
    ]
    return said_s * median(ratios[-_NEWEST:]) if ratios else said_s


def figure_s(stage: str, task: Task | Run, warm: bool, speeds: Mapping[str, Speed]) -> float | None:
    """What the figures say of one stage [s]; None for work that is not counted and for a preset without figures."""
    figures, preset = stage_figures(), _LIKE.get(task.preset, task.preset)
    if stage == "solve":
        speed = speeds.get(task.preset)
        return None if speed is None or task.work is None else speed.seconds(Work(task.work, 0.0))
    if stage in ("read", "measure"):
        line = figures.read if stage == "read" else figures.measure
        return line.fixed_s + line.s_per_pixel * task.pixels
    if stage == "start":
        return figures.start_s
    return {"compile": figures.warm_s if warm else figures.cold_s, "report": figures.report_s}[stage].get(
        preset
    )


@functools.cache
def stage_figures() -> Figures:
    """The packaged figures."""
    return parse(json.loads(FIGURES.read_text(encoding="utf-8")), Figures, str(FIGURES))


def source(runs: Iterable[Run] | None = None) -> str:
    """Where times come from, in words."""
    count = len(tuple(kept_runs() if runs is None else runs))
    if count:
        return f"as {count} run{'s' if count > 1 else ''} on this machine took"
    return this_machine()[1]


def total(seconds: Iterable[float | None]) -> float | None:
    """The sum; None where one is not known."""
    every = list(seconds)
    known = [one for one in every if one is not None]
    return sum(known) if len(known) == len(every) else None


def in_words(seconds: float) -> str:
    """A time as a person says it."""
    if seconds < 120:
        return f"{max(1, round(seconds))} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds < 172_800 else f"{seconds / 86_400:.0f} days"


def _nearest(task: Task, runs: tuple[Run, ...]) -> tuple[Run, ...]:
    """The runs of the same scene and preset; without any those of the preset; without any all."""
    own = tuple(run for run in runs if run.preset == task.preset)
    return tuple(run for run in own if _alike(run, task)) or own or runs


def _alike(run: Run, task: Task) -> bool:
    return (run.preset, run.scene, run.pixels) == (task.preset, task.scene, task.pixels)
