"""Several cameras calibrated together: a board that all of them see, one place after another, and the adjustment."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.models.together import (
    MovedResource,
    NewTogether,
    PairResource,
    PlaceResource,
    PlacesRequest,
    PlacesResource,
    SeenResource,
    SightResource,
    TogetherResource,
)
from app.api.resources.calibrations import calibration_resource
from app.api.services import Given, Services
from app.api.wire.board import board_settings
from app.api.wire.identifier import Identifier
from app.calibrate.folder import CalibrationFolder
from app.calibrate.service import GuideState
from app.calibrate.together import pairs_of, summary, together
from app.calibrate.together_live import TogetherPlan
from app.calibrate.together_service import TogetherStatus
from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.views import own_cameras
from calibration.together import Stated

router = APIRouter(tags=["calibrations"])
Wanted = Annotated[int, Query(ge=1, le=100, description="How many places are asked for.")]


@router.post("/experiments/{experiment}/calibration/together", status_code=201)
def calibrate_together(given: Given, experiment: Identifier, new: NewTogether) -> TogetherResource:
    """Adjust the calibrated views together, by boards that several cameras saw and a projector that they share."""
    found = given.folders.open(experiment)
    told = summary(together(CalibrationFolder(found.folder), Stated(tape_std_m=new.tape_std_m)))
    given.ledger.append_event("experiment", {"experiment": experiment, "calibrated": True})
    return TogetherResource(
        pairs=[PairResource.model_validate(pair) for pair in told["pairs"]],
        moved=[
            MovedResource(view=name, moved_m=one["moved_m"], position_std_m=one["position_std_m"])
            for name, one in told["views"].items()
        ],
        boards=told["boards"],
        rms_px=told["rms_px"],
        issues=told["issues"],
        calibration=calibration_resource(found),
    )


@router.get("/experiments/{experiment}/calibration/together")
def read_places(given: Given, experiment: Identifier, places: Wanted = 6) -> PlacesResource:
    """Return what is wanted next, what each camera found of the newest place, and the places that are there."""
    return _resource(given, given.folders.open(experiment), PlacesRequest(places=places))


@router.post("/experiments/{experiment}/calibration/together/places", status_code=202)
def take_place(given: Given, experiment: Identifier, request: PlacesRequest) -> PlacesResource:
    """Take a picture by every camera at once; follow it by the `calibration` events, or by asking."""
    found = given.confirmed.check(given.folders.open(experiment))
    given.together.take(found, _plan(found, request))
    return _resource(given, found, request)


@router.delete("/experiments/{experiment}/calibration/together/places/{place}")
def retake_place(given: Given, experiment: Identifier, place: Identifier) -> PlacesResource:
    """Forget a place, so that another one is asked for."""
    found = given.folders.open(experiment)
    given.together.retake(found, _plan(found, PlacesRequest()), place)
    return _resource(given, found, PlacesRequest())


@router.post("/experiments/{experiment}/calibration/together/skip")
def skip_place(given: Given, experiment: Identifier, request: PlacesRequest) -> PlacesResource:
    """Do with one place less."""
    found = given.folders.open(experiment)
    given.together.skip(found, _plan(found, request))
    return _resource(given, found, request)


@router.post("/experiments/{experiment}/calibration/together/stop")
def stop_place(given: Given, experiment: Identifier) -> PlacesResource:
    """Stop within a frame; the places that were taken are kept."""
    found = given.folders.open(experiment)
    given.guide.stop()
    return _resource(given, found, PlacesRequest())


@router.delete("/experiments/{experiment}/calibration/together")
def discard_places(given: Given, experiment: Identifier) -> PlacesResource:
    """Forget all places; the calibration in use stays as it is."""
    found = given.folders.open(experiment)
    given.together.discard(found)
    return _resource(given, found, PlacesRequest())


def _plan(experiment: Experiment, request: PlacesRequest) -> TogetherPlan:
    """Raises BadInputError where nobody has stated the board."""
    settings = experiment.settings.rig.board if request.board is None else board_settings(request.board)
    if settings is None:
        raise BadInputError(
            "The board is not known. State it under Board on the page, or as a [rig.board] table in "
            "experiment.toml."
        )
    return TogetherPlan(settings.board(), request.frames, request.places)


def _resource(given: Services, experiment: Experiment, request: PlacesRequest) -> PlacesResource:
    calibration, status, reason = CalibrationFolder(experiment.folder), None, ""
    try:
        status = given.together.status(experiment, _plan(experiment, request))
    except BadInputError as error:
        reason = str(error)
    now = given.guide.status if status is None else status.now
    own = status is not None and now.experiment == experiment.folder.name
    running = own and now.state is GuideState.running
    wanted = None if status is None else now.wanted if running else status.wanted
    bundle = calibration.bundle()
    joint = bundle.joint
    tied = {c.name: c for c in bundle.cameras if joint is not None and c.name in joint.parts}
    return PlacesResource(
        state=now.state.value if own else "idle",
        busy=given.guide.status.state is GuideState.running,
        reason=now.reason if own else reason,
        wanted=None if wanted is None else wanted.text,
        enough=status is not None and status.wanted is None,
        issues=list(now.issues) if own else [],
        cameras=_cameras(experiment, status),
        places=[
            PlaceResource(
                place=board.name,
                seen=[SeenResource(view=view, points=len(one.camera_px)) for view, one in board.seen.items()],
            )
            for board in calibration.shared().boards
        ],
        pairs=[] if joint is None else [PairResource.model_validate(pair) for pair in pairs_of(joint, tied)],
    )


def _cameras(experiment: Experiment, status: TogetherStatus | None) -> list[SightResource]:
    views = experiment.settings.scene.views
    newest = {} if status is None else status.newest
    return [
        SightResource(
            view=views[number].name,
            camera=number,
            width_px=views[number].camera.width_px,
            height_px=views[number].camera.height_px,
            points_px=[]
            if views[number].name not in newest
            else [(u, v) for u, v in newest[views[number].name].camera_px],
        )
        for number in own_cameras(experiment)
    ]
