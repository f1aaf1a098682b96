"""The guided calibration of an experiment's rig: what to show, take it, retake it, how good it is."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.models.guide import GuideRequest, GuideResource, GuideView, StepText, WantedResource
from app.api.services import Given, Services
from app.api.wire.board import board_settings
from app.api.wire.identifier import Identifier
from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import LivePlan
from app.calibrate.placement import placed
from app.calibrate.service import GuideState
from app.calibrate.state import state_of
from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.views import view_names, view_number
from app.rig.conditions import Conditions
from app.rig.stage import StageTask
from calibration.board import Board

router = APIRouter(tags=["calibrations"])
StepQuery = Annotated[StepText, Query(description="Which step of the calibration.")]
CameraQuery = Annotated[
    str | None, Query(alias="camera", max_length=200, description="Which view's camera, by the view's name.")
]


@router.get("/experiments/{experiment}/calibration/guide")
def read_guide(
    given: Given, experiment: Identifier, step: StepQuery = "camera", camera: CameraQuery = None
) -> GuideResource:
    """Return what is wanted next and how good the step is so far."""
    found = given.folders.open(experiment)
    return _resource(given, found, _plan(found, GuideRequest(step=step, view=camera)))


@router.post("/experiments/{experiment}/calibration/guide", status_code=202)
def take_guided(given: Given, experiment: Identifier, request: GuideRequest) -> GuideResource:
    """Take the pictures of what is wanted next; follow it by the `calibration` events, or by asking."""
    found = given.confirmed.check(given.folders.open(experiment))
    plan = _plan(found, request)
    given.guide.take(found, plan, Conditions(request.ambient_temperature_k, request.minutes_on))
    return _resource(given, found, plan)


@router.post("/experiments/{experiment}/calibration/guide/skip")
def skip_guided(given: Given, experiment: Identifier, request: GuideRequest) -> GuideResource:
    """Do without what is wanted now."""
    found = given.folders.open(experiment)
    plan = _plan(found, request)
    given.guide.skip(found, plan)
    return _resource(given, found, plan)


@router.post("/experiments/{experiment}/calibration/guide/stop")
def stop_guided(
    given: Given, experiment: Identifier, step: StepQuery = "camera", camera: CameraQuery = None
) -> GuideResource:
    """Stop within a frame; the pictures taken so far are kept."""
    found = given.folders.open(experiment)
    given.guide.stop()
    return _resource(given, found, _plan(found, GuideRequest(step=step, view=camera)))


@router.delete("/experiments/{experiment}/calibration/guide")
def discard_guided(
    given: Given, experiment: Identifier, step: StepQuery = "camera", camera: CameraQuery = None
) -> GuideResource:
    """Forget what a step has taken and not completed; the calibration in use stays as it is."""
    found = given.folders.open(experiment)
    plan = _plan(found, GuideRequest(step=step, view=camera))
    given.guide.discard(found, plan)
    return _resource(given, found, plan)


@router.delete("/experiments/{experiment}/calibration/views/{view}")
def retake_view(
    given: Given,
    experiment: Identifier,
    view: Identifier,
    step: StepQuery = "camera",
    camera: CameraQuery = None,
) -> GuideResource:
    """Forget a view, so that it is asked for again."""
    found = given.folders.open(experiment)
    plan = _plan(found, GuideRequest(step=step, view=camera))
    given.guide.retake(found, plan, view)
    return _resource(given, found, plan)


def _plan(experiment: Experiment, request: GuideRequest) -> LivePlan:
    camera = view_names(experiment)[view_number(experiment, request.view)]
    anchor_px, across_m = None, None
    if request.anchor is not None:
        u, v, *across_m = request.anchor
        anchor_px = (u, v)
    place = placed(experiment.settings.scene, camera, anchor_px, across_m, plumb_px=request.plumb_px)
    return LivePlan(
        StepName(request.step),
        camera,
        _board(experiment, request),
        request.frames,
        request.response_frames,
        0.0 if experiment.settings.rig.camera_kind == "simulated" else request.settle_s,
        place,
    )


def _board(experiment: Experiment, request: GuideRequest) -> Board | None:
    """The board of the request, else of the experiment."""
    if request.board is not None:
        return board_settings(request.board).board()
    own = experiment.settings.rig.board
    return None if own is None else own.board()


def _resource(given: Services, experiment: Experiment, plan: LivePlan) -> GuideResource:
    status = given.guide.status
    asked = (experiment.folder.name, plan.step, plan.camera)
    own = (status.experiment, status.step, status.camera) == asked
    running = own and status.state is GuideState.running
    reason = status.reason if own else ""
    try:
        wanted = status.wanted if running else given.guide.wanted(experiment, plan)
    except BadInputError as error:
        wanted, reason = None, str(error)
    folder = CalibrationFolder(experiment.folder)
    state = state_of(folder, folder.collected(plan.camera), plan.step)
    return GuideResource(
        state=status.state.value if own else "idle",
        busy=status.state is GuideState.running,
        step=plan.step.value,
        view=plan.camera,
        reason=reason,
        wanted=None if wanted is None else _wanted(wanted),
        done=status.done if own else 0,
        total=status.total if own else 0,
        issues=list(status.issues) if own else [],
        complete=state.complete,
        started=folder.started(plan.camera) is plan.step,
        views=[
            GuideView(name=v.name, points=v.points, rms_px=v.rms_px, issues=list(v.issues))
            for v in state.views
        ],
        width_px=None if state.size_px is None else state.size_px[0],
        height_px=None if state.size_px is None else state.size_px[1],
        coverage=[list(row) for row in state.coverage],
        covered=state.covered,
        rms_px=state.rms_px,
        residuals_px=list(state.residuals_px),
        advice=list(state.advice),
    )


def _wanted(task: StageTask) -> WantedResource:
    view = task.view
    return WantedResource(
        kind=task.kind,
        text=task.text,
        column=None if view is None else view.column,
        row=None if view is None else view.row,
        span=None if view is None else view.span,
        nearer="" if view is None else view.nearer,
        tilt_deg=0.0 if view is None or not view.nearer else view.tilt_deg,
        roll_deg=0.0 if view is None else view.roll_deg,
    )
