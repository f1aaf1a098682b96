"""Experiments: one folder each; the rig, the scene, and counts of what was taken and computed."""

import contextlib
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response

from app.api.folders import shown_name
from app.api.models.experiments import (
    ExperimentChange,
    ExperimentLine,
    ExperimentResource,
    MarksModel,
    NewExperiment,
    NextResource,
    SeenWallLine,
)
from app.api.services import Given, Services
from app.api.wire.board import board_settings
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.api.wire.revision import IfMatch, check_revision, etag
from app.calibrate.parts import is_calibrated, parts_of
from app.errors import BadInputError
from app.experiment.folder import SETTINGS_FILE, Experiment, finished, save_settings
from app.experiment.plan import PLAN_FILE
from app.experiment.views import lamp_number, opened_for
from app.files.reading import reading
from app.files.toml import to_plain
from app.rig.open import named_projector
from app.simulate.rehearsal import Rehearsal, rehearse
from app.whereabouts import next_step
from core.scene import Light, Marks, ProjectedPattern, Scene

router = APIRouter(tags=["experiments"])


@router.get("/experiments")
def list_experiments(given: Given) -> list[ExperimentLine]:
    """List the experiments, newest first."""
    return [_line_or_reason(given, folder) for folder in given.folders.all()]


@router.post("/experiments", status_code=201)
def create_experiment(given: Given, new: NewExperiment, response: Response) -> ExperimentResource:
    """Make an experiment with a simulated rig, ready to be connected."""
    made = rehearse(
        given.folders.root, Rehearsal(new.title, new.camera_px, new.light, new.boundary, new.world)
    )
    given.ledger.append_event("experiment", {"experiment": made.folder.name, "created": True})
    return experiment_resource(made, response)


@router.get("/experiments/{experiment}")
def read_experiment(given: Given, experiment: Identifier, response: Response) -> ExperimentResource:
    """Return one experiment."""
    return experiment_resource(given.folders.open(experiment), response)


@router.patch("/experiments/{experiment}")
def change_experiment(
    given: Given,
    experiment: Identifier,
    change: ExperimentChange,
    response: Response,
    if_match: IfMatch = None,
) -> ExperimentResource:
    """Change title, notes, the board to calibrate with, or the marks; what is left out stays as somebody left it."""
    words = change.model_dump(exclude_none=True, exclude={"board", "marks"})
    board = None if change.board is None else board_settings(change.board)
    with given.folders.locked(experiment):
        found = given.folders.open(experiment)
        check_revision(if_match, _changeable(found), change.model_dump(exclude_none=True))
        if board is not None:
            words["rig"] = found.settings.rig.model_copy(update={"board": board})
        if change.marks is not None:
            words["scene"] = _marked(found.settings.scene, change.marks)
        saved = save_settings(found.folder, found.settings.model_copy(update=words))
    return experiment_resource(saved, response)


def _changeable(experiment: Experiment) -> dict[str, Any]:
    """What a change may change, as it stands."""
    settings = experiment.settings
    board = None if settings.rig.board is None else settings.rig.board.model_dump()
    words = {"title": settings.title, "information": settings.information}
    marks = [asdict(one) for one in settings.scene.views[0].marks]
    return {"revision": experiment.revision, **words, "board": board, "marks": marks}


def _marked(scene: Scene, marks: list[MarksModel]) -> Scene:
    """The scene with these marks in its first view. Raises SettingError."""
    first, *others = scene.views
    corners = [[(float(column), float(row)) for column, row in (one.lower_px, one.upper_px)] for one in marks]
    drawn = tuple(
        Marks(name=one.name, lower_px=low, upper_px=high)
        for one, (low, high) in zip(marks, corners, strict=True)
    )
    return replace(scene, views=(replace(first, marks=drawn), *others))


def _line_or_reason(given: Services, folder: Path) -> ExperimentLine:
    try:
        with reading(folder, "Correct or remove it."):
            return _line(given.folders.open(folder.name))
    except (BadInputError, ApiError) as error:
        return ExperimentLine(
            experiment=shown_name(folder),
            title=shown_name(folder),
            information="",
            camera="",
            projector=False,
            light="texture",
            calibrated=False,
            uncalibrated=[],
            planned=False,
            captures=0,
            results=0,
            changed=_changed(folder),
            revision="",
            views=[],
            reason=str(error) or "It cannot be read.",
        )


def _changed(folder: Path) -> str:
    with contextlib.suppress(OSError, ValueError, OverflowError):
        changed_s = (folder / SETTINGS_FILE).stat().st_mtime
        return datetime.fromtimestamp(changed_s, UTC).isoformat(timespec="seconds")
    return ""


def _line(experiment: Experiment) -> ExperimentLine:
    settings, parts = experiment.settings, parts_of(experiment)
    return ExperimentLine(
        experiment=experiment.folder.name,
        title=settings.title,
        information=settings.information,
        camera=settings.rig.camera_kind,
        projector=settings.rig.projector is not None,
        light=_kind(settings.scene.light),
        calibrated=is_calibrated(parts),
        uncalibrated=[part.step.value for part in parts if part.needed and part.state == "missing"],
        planned=(experiment.folder / PLAN_FILE).is_file(),
        captures=len(finished(experiment.captures_folder)),
        results=len(finished(experiment.results_folder)),
        changed=_changed(experiment.folder),
        revision=experiment.revision,
        next=_next(experiment),
        views=[
            SeenWallLine(
                name=view.name,
                wall=view.wall,
                camera=opened_for(experiment, number),
                camera_of=view.camera_of,
                light=_kind(view.light or settings.scene.light),
                lamp=lamp_number(experiment, number),
                spoken_to=named_projector(experiment, lamp_number(experiment, number)) is not None,
            )
            for number, view in enumerate(settings.scene.views)
        ],
    )


def _kind(light: Light) -> Literal["texture", "projector"]:
    return "projector" if isinstance(light, ProjectedPattern) else "texture"


def _next(experiment: Experiment) -> NextResource | None:
    """What comes next, as `airlens status` tells it, without what is only advised; None where files are broken."""
    try:
        found = next_step(experiment, experiment.folder.name, advised=False)
    except BadInputError:
        return None
    return NextResource(step=found.step.value, command=found.command, reason=found.reason)


def experiment_resource(experiment: Experiment, response: Response) -> ExperimentResource:
    """An experiment as it is answered, with its revision in the header."""
    response.headers.update(etag(experiment.revision))
    return ExperimentResource(**_line(experiment).model_dump(), settings=to_plain(experiment.settings))
