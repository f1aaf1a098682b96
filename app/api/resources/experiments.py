"""Experiments: one folder each; the rig, the scene, and counts of what was taken and computed."""

from datetime import UTC, datetime
from typing import Any, Literal

from fastapi import APIRouter
from pydantic import Field

from app.api.services import Given
from app.api.wire.board import BoardGeometry
from app.api.wire.strict import Identifier, Strict
from app.calibrate.parts import is_calibrated, parts_of
from app.experiment.folder import Experiment, finished, save_settings
from app.experiment.plan import PLAN_FILE
from app.files.toml import to_plain
from app.simulate.rehearsal import Rehearsal, rehearse
from core.scene import ProjectedPattern

router = APIRouter(tags=["experiments"])


class ExperimentLine(Strict):
    """One line of the list of experiments; `uncalibrated` names the parts of the rig that need it still."""

    experiment: str
    title: str
    information: str
    camera: str
    projector: bool
    light: Literal["texture", "projector"]
    calibrated: bool
    uncalibrated: list[str]
    planned: bool
    captures: int
    results: int
    changed: str


class ExperimentResource(ExperimentLine):
    """One experiment with its rig and scene as they stand in experiment.toml."""

    settings: dict[str, Any]


class NewExperiment(Strict):
    """A simulated rig before the packaged room; real rigs are described in experiment.toml."""

    kind: Literal["simulated"]
    title: str = Field(default="Simulated room", min_length=1, max_length=200)
    camera_px: int = Field(default=384, ge=64, le=4096)
    light: Literal["texture", "projector"] = "texture"
    boundary: Literal["paper", "operator", "surveyed"] = "surveyed"


class ExperimentChange(Strict):
    """What people wrote about it, and the board that its rig is calibrated with."""

    title: str | None = Field(default=None, max_length=200)
    information: str | None = Field(default=None, max_length=10_000)
    board: BoardGeometry | None = None


@router.get("/experiments")
def list_experiments(given: Given) -> list[ExperimentLine]:
    """List the experiments, newest first."""
    return [_line(given.folders.open(folder.name)) for folder in given.folders.all()]


@router.post("/experiments", status_code=201)
def create_experiment(given: Given, new: NewExperiment) -> ExperimentResource:
    """Make an experiment with a simulated rig, ready to be connected."""
    made = rehearse(given.folders.root, Rehearsal(new.title, new.camera_px, new.light, new.boundary))
    given.ledger.append_event("experiment", {"experiment": made.folder.name, "created": True})
    return _resource(made)


@router.get("/experiments/{experiment}")
def read_experiment(given: Given, experiment: Identifier) -> ExperimentResource:
    """Return one experiment."""
    return _resource(given.folders.open(experiment))


@router.patch("/experiments/{experiment}")
def change_experiment(given: Given, experiment: Identifier, change: ExperimentChange) -> ExperimentResource:
    """Change title, notes, or the board to calibrate with."""
    found = given.folders.open(experiment)
    words = change.model_dump(exclude_none=True, exclude={"board"})
    if change.board is not None:
        words["rig"] = found.settings.rig.model_copy(update={"board": change.board.settings()})
    return _resource(save_settings(found.folder, found.settings.model_copy(update=words)))


def _line(experiment: Experiment) -> ExperimentLine:
    settings, parts = experiment.settings, parts_of(experiment)
    changed_s = (experiment.folder / "experiment.toml").stat().st_mtime
    return ExperimentLine(
        experiment=experiment.folder.name,
        title=settings.title,
        information=settings.information,
        camera=settings.rig.camera.kind,
        projector=settings.rig.projector is not None,
        light="projector" if isinstance(settings.scene.light, ProjectedPattern) else "texture",
        calibrated=is_calibrated(parts),
        uncalibrated=[part.step.value for part in parts if part.needed and part.state == "missing"],
        planned=(experiment.folder / PLAN_FILE).is_file(),
        captures=len(finished(experiment.captures_folder)),
        results=len(finished(experiment.results_folder)),
        changed=datetime.fromtimestamp(changed_s, UTC).isoformat(timespec="seconds"),
    )


def _resource(experiment: Experiment) -> ExperimentResource:
    return ExperimentResource(**_line(experiment).model_dump(), settings=to_plain(experiment.settings))
