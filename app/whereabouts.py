"""Where an experiment stands, and what comes next: the one rule, for `airlens status` and for `airlens` alone."""

import contextlib
import shlex
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from app.calibrate.parts import Part, parts_of, ties_of
from app.errors import BadInputError
from app.experiment.capture_parts import parts_of as capture_parts
from app.experiment.folder import (
    Experiment,
    finished,
    interrupted,
    open_experiment,
    read_manifest,
)
from app.experiment.plan import PLAN_FILE
from app.experiment.printed import is_of_the_scene, read_printed
from app.experiment.rig_settings import RealCameraSettings
from app.experiment.views import printed_walls, view_names
from app.reconstruct.problem import known_of, problem_of
from core.scene import FixedTexture
from core.setting import SettingError


class Step(StrEnum):
    """The steps of the work, in their order."""

    camera = "camera"
    plan = "plan"
    print_pattern = "print pattern"
    print_board = "print board"
    calibrate = "calibrate"
    together = "calibrate together"
    reference = "reference"
    flow = "flow"
    reconstruct = "reconstruct"
    report = "report"
    export = "export"


@dataclass(frozen=True)
class Next:
    """The step that comes next, the command that does it, and why."""

    step: Step
    command: str
    reason: str


# What a rig can be measured with without.
ADVISED = frozenset({Step.plan, Step.print_pattern, Step.print_board, Step.together})


@dataclass(frozen=True)
class Whereabouts:
    """What an experiment has, as sentences by their subject, and what comes next."""

    experiment: str
    title: str
    has: dict[str, str]
    next: Next


def whereabouts(folder: Path, shown: str = "") -> Whereabouts:
    """Look at an experiment; `shown` is how its folder is written in the next command. Raises BadInputError."""
    experiment = open_experiment(folder)
    has = {
        "rig": _rig(experiment),
        "scene": _refused(experiment),
        "plan": "made" if (experiment.folder / PLAN_FILE).is_file() else "none yet",
        "print": _print(experiment),
        "calibration": _calibration(parts_of(experiment), experiment),
        "captures": _captures(experiment),
        "results": _results(experiment),
    }
    told = {name: text for name, text in has.items() if text}
    following = next_step(experiment, shown or str(folder))
    return Whereabouts(str(folder), experiment.settings.title, told, following)


def next_step(experiment: Experiment, shown: str, advised: bool = True) -> Next:
    """The first step of the work that is not done; `advised` ones may be passed over. Commands quote `shown`.

    Raises BadInputError for files that cannot be read.
    """
    shown = shlex.quote(shown)
    rules = (
        _of_the_rig,
        _of_the_plan,
        _of_the_print,
        _of_the_calibration,
        _of_the_ties,
        _of_the_captures,
        _of_the_scene,
        _of_the_results,
    )
    for rule in rules:
        found = rule(experiment, shown)
        if found is not None and (advised or found.step not in ADVISED):
            return found
    newest = experiment.latest_result()
    return Next(
        Step.export,
        f"airlens export {shown}",
        f"{newest / 'report.html'} is there to be read. Other programs read exports",
    )


def _of_the_rig(experiment: Experiment, shown: str) -> Next | None:
    taken = finished(experiment.captures_folder)
    if experiment.settings.rig.camera is None and not taken:
        return Next(
            Step.camera,
            "airlens devices --full",
            "no camera is named: write one of these under [rig.camera] in experiment.toml",
        )
    return None


def _of_the_plan(experiment: Experiment, shown: str) -> Next | None:
    if not finished(experiment.captures_folder) and not (experiment.folder / PLAN_FILE).is_file():
        return Next(
            Step.plan, f"airlens plan {shown}", "nothing is measured yet: see first what this rig would see"
        )
    return None


def _of_the_print(experiment: Experiment, shown: str) -> Next | None:
    """What must hang on the wall, or be held before the camera, of a rig that is no simulation."""
    rig = experiment.settings.rig
    if not isinstance(rig.camera, RealCameraSettings) or finished(experiment.captures_folder):
        return None
    for number in printed_walls(experiment):
        printed, view = read_printed(experiment, "pattern", number), experiment.settings.scene.views[number]
        only = f" --view {shlex.quote(view.name)}" if number else ""
        whose = f"the wall {view.wall}" if number else "the wall"
        if printed is None:
            return Next(
                Step.print_pattern, f"airlens print pattern {shown}{only}", f"{whose} needs its pattern"
            )
        if not is_of_the_scene(printed, experiment):
            return Next(
                Step.print_pattern,
                f"airlens print pattern {shown}{only}",
                f"the pattern of {whose} is another than the printed one"
                if number
                else "the scene's pattern is another than the printed one",
            )
    if rig.board is None and _missing(experiment)[:1] == ["camera"]:
        return Next(
            Step.print_board, f"airlens print board {shown}", "the rig names no board to calibrate with"
        )
    return None


def _of_the_calibration(experiment: Experiment, shown: str) -> Next | None:
    missing = _missing(experiment)
    if not missing:
        return None
    command = f"airlens calibrate {missing[0]} {shown}"
    lacking = next(part.lacking for part in parts_of(experiment) if part.step.value == missing[0])
    if len(experiment.settings.scene.views) > 1 and lacking:
        command += f" --view {shlex.quote(lacking[0])}"
    return Next(Step.calibrate, command, f"not calibrated yet: {', '.join(missing)}")


def _of_the_ties(experiment: Experiment, shown: str) -> Next | None:
    """Before anything is taken: later, cameras may have moved since their boards."""
    tied = ties_of(experiment)
    if tied is None or tied.joint or finished(experiment.captures_folder):
        return None
    return Next(
        Step.together,
        f"airlens calibrate together {shown}",
        "each view is calibrated by itself; a board that several cameras see ties them to a millimetre",
    )


def _of_the_captures(experiment: Experiment, shown: str) -> Next | None:
    frames = max(view.frames for view in experiment.settings.scene.views)
    roles = _roles(experiment)
    reasons = {"reference": "with still air", "flow": "with the air moving"}
    for role, reason in reasons.items():
        if not roles[role]:
            lacking = _lacking(experiment, role)
            if lacking is not None:
                folder, view = lacking
                return Next(
                    Step(role),
                    f"airlens capture retake {shown} --view {shlex.quote(view)} --capture {folder.name}",
                    f"the {role} lacks the picture of {view}; those of the other cameras are kept",
                )
            return Next(
                Step(role),
                f"airlens capture {role} {shown} --frames {frames}",
                f"the {role} is missing: take it {reason}",
            )
    return None


def _lacking(experiment: Experiment, role: str) -> tuple[Path, str] | None:
    """The newest capture of a role that some cameras took and not all, and the first view that it lacks."""
    for folder in reversed(_visible(interrupted(experiment.captures_folder))):
        with contextlib.suppress(BadInputError):
            parts = capture_parts(folder, view_names(experiment))
            taken = parts.views and parts.origin.get("rig") != "imported"
            if taken and parts.role == role and parts.missing:
                return folder, parts.missing[0]
    return None


def _of_the_scene(experiment: Experiment, shown: str) -> Next | None:
    """A scene that is refused is mended before anything is computed of it."""
    refused = _refused(experiment)
    if not refused:
        return None
    return Next(
        Step.reconstruct, f"airlens reconstruct {shown}", f"mend experiment.toml first. It is {refused}"
    )


def _refused(experiment: Experiment) -> str:
    """Why the scene cannot be reconstructed, whatever the pictures show; empty where it can."""
    try:
        problem_of(known_of(experiment), ())
    except (BadInputError, SettingError) as error:
        return f"refused: {error}".removesuffix(".")
    return ""


def _of_the_results(experiment: Experiment, shown: str) -> Next | None:
    command = f"airlens reconstruct {shown}"
    if experiment.checkpoint_folder.is_dir():
        return Next(Step.reconstruct, command, "a reconstruction was stopped: it goes on from there")
    results = finished(experiment.results_folder)
    if not results:
        return Next(Step.reconstruct, command, "both captures are there")
    if not (results[-1] / "result.nc").is_file():
        return Next(
            Step.reconstruct, command, f"the newest result, {results[-1].name}, has lost its result.nc"
        )
    used = read_manifest(results[-1]).get("captures", {})
    newest = {role: experiment.latest_capture(role).name for role in ("reference", "flow")}
    if isinstance(used, dict) and any(used.get(role, name) != name for role, name in newest.items()):
        return Next(Step.reconstruct, command, "there are newer captures than those of the newest result")
    if not (results[-1] / "report.html").is_file():
        return Next(Step.report, f"airlens report {shown}", "the newest result has no report")
    return None


def _missing(experiment: Experiment) -> list[str]:
    return [part.step.value for part in parts_of(experiment) if part.needed and part.state == "missing"]


def _roles(experiment: Experiment) -> Counter[str]:
    return Counter(str(read_manifest(folder).get("role")) for folder in finished(experiment.captures_folder))


def _rig(experiment: Experiment) -> str:
    rig, scene = experiment.settings.rig, experiment.settings.scene
    camera = "no camera named" if rig.camera is None else f"{rig.camera_kind} camera"
    if isinstance(rig.camera, RealCameraSettings):
        named = [rig.camera, *(rig.cameras or {}).values()]
        camera = ("camera " if len(named) == 1 else "cameras ") + ", ".join(one.device for one in named)
    light = "a printed pattern" if isinstance(scene.light, FixedTexture) else "a projector"
    return f"{camera} before {light}; a room of {' x '.join(f'{size:g}' for size in scene.room.size_m)} m"


def _print(experiment: Experiment) -> str:
    walls = printed_walls(experiment)
    told = [_print_of(experiment, number) for number in walls]
    views = experiment.settings.scene.views
    named = [f"{views[number].wall}: {text}" for number, text in zip(walls, told, strict=True)]
    return "; ".join(told if len(told) == 1 else named)


def _print_of(experiment: Experiment, view: int) -> str:
    printed = read_printed(experiment, "pattern", view)
    if printed is None:
        return "none yet"
    rows, cols = printed.sheets
    state = "" if is_of_the_scene(printed, experiment) else ", of another pattern than the scene's"
    return f"{rows * cols} sheets of {printed.paper}, {printed.created[:10]}{state}"


def _calibration(parts: tuple[Part, ...], experiment: Experiment) -> str:
    text, tied = ", ".join(f"{part.step.value} {part.state}" for part in parts), ties_of(experiment)
    return text if tied is None else f"{text}; {tied.text}"


def _captures(experiment: Experiment) -> str:
    roles = _roles(experiment)
    counted = [f"{roles[role]} {role}" for role in ("reference", "flow")]
    return ", ".join(counted) + _left(experiment.captures_folder)


def _results(experiment: Experiment) -> str:
    found = finished(experiment.results_folder)
    newest = f"{len(found)}, the newest {found[-1].name}" if found else "none yet"
    return newest + _left(experiment.results_folder)


def _left(parent: Path) -> str:
    left = _visible(interrupted(parent))
    return f", {len(left)} interrupted" if left else ""


def _visible(folders: list[Path]) -> list[Path]:
    return [folder for folder in folders if not folder.name.startswith(".")]


def each(folders: list[Path], shown: Callable[[Path], str] = str) -> list[tuple[Path, str, str]]:
    """Every experiment of a data folder: where it is, its title, its next command or what is wrong with it."""
    rows = []
    for folder in folders:
        title, following = "", ""
        with contextlib.suppress(OSError):
            try:
                found = whereabouts(folder, shown(folder))
                title, following = found.title, found.next.command
            except BadInputError as error:
                following = str(error)
            rows.append((folder, title, following))
    return rows
