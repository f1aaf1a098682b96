"""Which parts of an experiment's rig are calibrated, which stand as they were given, and which are missing."""

from dataclasses import dataclass
from typing import Literal

from app.calibrate.folder import CalibrationFolder, StepName
from app.experiment.folder import Experiment
from calibration.bundle import Bundle, Quality
from core.scene import ProjectedPattern

PartState = Literal["measured", "given", "missing"]


@dataclass(frozen=True)
class Part:
    """One step's outcome, of all views together. A rig without a `needed` one is not calibrated; a response may stay
    nominal. `lacking` names the views in which it is missing.
    """

    step: StepName
    state: PartState
    needed: bool = True
    lacking: tuple[str, ...] = ()


def parts_of(experiment: Experiment) -> tuple[Part, ...]:
    """Every part that this rig has, in the order in which they are calibrated. Raises BadInputError."""
    scene = experiment.settings.scene
    by_step: dict[StepName, dict[str, Quality | None]] = {step: {} for step in StepName}
    for number, view in enumerate(scene.views):
        own = bundle_of(experiment).of(view.name, number == 0)
        if isinstance(view.light or scene.light, ProjectedPattern):
            by_step[StepName.projector][view.name] = None if own.projector is None else own.projector.quality
        if view.camera_of is not None:
            continue  # all but its projector is that of the camera's own view
        response = own.response()
        by_step[StepName.camera][view.name] = own.cameras[0].quality if own.cameras else None
        by_step[StepName.wall][view.name] = None if own.wall is None else own.wall.quality
        by_step[StepName.response][view.name] = None if response is None else response.quality
    return tuple(_part(step, found) for step, found in by_step.items() if found)


def _part(step: StepName, found: dict[str, Quality | None]) -> Part:
    lacking = tuple(name for name, quality in found.items() if quality is None)
    return Part(step, _state(*found.values()), step is not StepName.response, lacking)


@dataclass(frozen=True)
class Ties:
    """Whether the views' places are `joint`, found together, and in words what ties them."""

    joint: bool
    text: str


def ties_of(experiment: Experiment) -> Ties | None:
    """What ties several views that were calibrated from pictures; None of one, or of views that were given."""
    bundle, names = bundle_of(experiment), [view.name for view in experiment.settings.scene.views]
    measured = [c.name for c in bundle.cameras if c.name in names and c.quality.source == "measured"]
    if len(measured) < 2:
        return None
    joint = bundle.joint
    if joint is None:
        return Ties(False, "each view by itself, tied by the walls alone")
    by = f"{joint.boards} boards, residual {joint.rms_px:.3f} px" if joint.boards else "a common projector"
    return Ties(True, f"{', '.join(n for n in names if n in joint.parts)} adjusted together by {by}")


def is_calibrated(parts: tuple[Part, ...]) -> bool:
    """Whether nothing that is needed is missing."""
    return not any(part.needed and part.state == "missing" for part in parts)


def bundle_of(experiment: Experiment) -> Bundle:
    """The calibration so far; empty at first. Raises BadInputError."""
    return CalibrationFolder(experiment.folder).bundle()


def _state(*qualities: Quality | None) -> PartState:
    """The state of a part that consists of several: as sure as the least sure."""
    if None in qualities:
        return "missing"
    return "given" if any(q is not None and q.source == "given" for q in qualities) else "measured"
