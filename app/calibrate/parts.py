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
    """One step's outcome. A rig without a `needed` one is not calibrated; a response may stay nominal."""

    step: StepName
    state: PartState
    needed: bool = True


def parts_of(experiment: Experiment) -> tuple[Part, ...]:
    """Every part that this rig has, in the order in which they are calibrated. Raises BadInputError."""
    bundle, scene = bundle_of(experiment), experiment.settings.scene
    cameras = {camera.name: camera.quality for camera in bundle.cameras}
    parts = [Part(StepName.camera, _state(*(cameras.get(view.name) for view in scene.views)))]
    if isinstance(scene.light, ProjectedPattern):
        projector = bundle.projector
        parts.append(Part(StepName.projector, _state(None if projector is None else projector.quality)))
    parts.append(Part(StepName.wall, _state(None if bundle.wall is None else bundle.wall.quality)))
    responses = (bundle.response(view.name) for view in scene.views)
    response = _state(*(None if one is None else one.quality for one in responses))
    return (*parts, Part(StepName.response, response, needed=False))


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
