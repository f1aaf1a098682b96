"""Experiments: one folder each; the rig, the scene, and counts of what was taken and computed."""

from datetime import UTC, datetime

from fastapi import APIRouter

from app.api.models.experiments import ExperimentChange, ExperimentLine, ExperimentResource, NewExperiment
from app.api.services import Given
from app.api.wire.board import board_settings
from app.api.wire.identifier import Identifier
from app.calibrate.parts import is_calibrated, parts_of
from app.experiment.folder import Experiment, finished, save_settings
from app.experiment.plan import PLAN_FILE
from app.files.toml import to_plain
from app.simulate.rehearsal import Rehearsal, rehearse
from core.scene import ProjectedPattern

router = APIRouter(tags=["experiments"])


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
        words["rig"] = found.settings.rig.model_copy(update={"board": board_settings(change.board)})
    return _resource(save_settings(found.folder, found.settings.model_copy(update=words)))


def _line(experiment: Experiment) -> ExperimentLine:
    settings, parts = experiment.settings, parts_of(experiment)
    changed_s = (experiment.folder / "experiment.toml").stat().st_mtime
    return ExperimentLine(
        experiment=experiment.folder.name,
        title=settings.title,
        information=settings.information,
        camera=settings.rig.camera_kind,
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
