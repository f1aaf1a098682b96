"""Answers about a rig and its room: templates, their check while somebody types, experiments made from them."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Query, Response
from pydantic import TypeAdapter

from app.api.models.answers import (
    AnswersResource,
    AskPort,
    CheckResource,
    FoundCamera,
    MistakeResource,
    NewAnswers,
    PortAnswer,
    PortResource,
    RoomTold,
    SentAnswers,
    SupplyTold,
    TemplateResource,
    ViewTold,
)
from app.api.models.calibrations import StandingResource
from app.api.models.experiments import ExperimentResource
from app.api.resources.calibrations import corners_on
from app.api.resources.experiments import experiment_resource
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.api.wire.revision import IfMatch, check_revision, etag
from app.errors import BadInputError
from app.experiment.folder import ExperimentSettings
from app.experiment.rig_settings import RealCameraSettings
from app.files.toml import parse, to_plain, to_toml, toml_data
from app.files.toml_errors import Said
from app.rig.cameras import open_real
from app.rig.frame_statistics import jpeg_of
from app.rig.inventory import CameraKind, found_cameras, simulated_in
from app.rig.ports import found_ports, who_is_there
from app.setup.answers import Answers
from app.setup.experiment import (
    ANSWERS_FILE,
    SAMPLE,
    TEMPLATES,
    add_experiment,
    answers_of,
    change_answers,
    corner_of,
    room_of,
    template,
)
from app.setup.mistakes import field_name, mistakes_in
from app.setup.scene import picture_on_wall_m, settings_of, wall_m
from core.geometry import Box, Optics, WallName, face_of
from core.scene import Inlet, Light, ProjectedPattern, Scene

router = APIRouter(tags=["answers"])
JPEG_BODY = body("image/jpeg", "What the camera sees, its contrast stretched for the eyes.")


@router.get("/devices/found")
def list_found_cameras(given: Given) -> list[FoundCamera]:
    """List the cameras that are plugged in, and simulated ones: in the packaged room, and in uploaded ones."""
    return [FoundCamera.of(one) for one in (*found_cameras(), *simulated_in(given.uploads.rooms()))]


@router.get("/devices/found/picture", response_class=Response, responses=JPEG_BODY)
def read_found_picture(
    given: Given,
    kind: Annotated[CameraKind, Query()],
    device: Annotated[str, Query(max_length=1000)],
    pixel_format: Annotated[str, Query(max_length=40)],
    width_px: Annotated[int, Query(gt=0, le=20_000)],
    height_px: Annotated[int, Query(gt=0, le=20_000)],
) -> Response:
    """Return one picture of a camera that was found, for the eyes: is it this one?"""
    named = (
        one for one in found_cameras() if (one.kind, one.device) == (kind, device) and one.kind != "simulated"
    )
    if next(named, None) is None:
        raise ApiError("not_found", f"There is no camera {device!r} here.", "Plug it in.")
    wanted = {"kind": kind, "device": device, "pixel_format": pixel_format, "width_px": width_px}
    told = TypeAdapter(RealCameraSettings).validate_python({**wanted, "height_px": height_px})
    with open_real(told) as camera:
        return Response(jpeg_of(camera.grab(), stretch=True), media_type="image/jpeg")


@router.get("/devices/ports")
def list_ports(given: Given) -> list[PortResource]:
    """List the serial ports; none is opened."""
    return [PortResource.of(one) for one in found_ports()]


@router.post("/devices/ports/ask")
def ask_port(given: Given, asked: AskPort) -> PortAnswer:
    """Ask a serial port which projector is there: its power state and its name; nothing is switched."""
    if asked.device not in [one.device for one in found_ports()]:
        raise ApiError("not_found", f"There is no serial port {asked.device!r} here.", "Plug it in.")
    found = who_is_there(asked.device)
    return PortAnswer(found=False) if found is None else PortAnswer(found=True, **asdict(found))


@router.get("/answers/templates")
def list_templates(given: Given) -> list[TemplateResource]:
    """List filled-in answers to start from."""
    read = {name: toml_data(template(name), name) for name in TEMPLATES}
    return [TemplateResource(template=n, title=str(data["title"]), answers=data) for n, data in read.items()]


@router.post("/answers/check")
def check_answers(given: Given, sent: SentAnswers) -> CheckResource:
    """Return every mistake at its field; where there is none, what the answers make."""
    found = None if sent.experiment is None else given.folders.open(sent.experiment)
    wrong = _mistakes(given, sent.answers, None if found is None else answers_of(found).answers)
    if wrong:
        lines = [MistakeResource(field=field_name(one.path), sentence=one.sentence) for one in wrong]
        return CheckResource(mistakes=lines, told=None)
    answers = parse(sent.answers, Answers, ANSWERS_FILE)
    corner_m = corner_of(_room(given, sent.answers)) if found is None else found.settings.scene.room.lower_m
    try:
        return CheckResource(mistakes=[], told=_told(settings_of(answers, corner_m)))
    except BadInputError as error:
        return CheckResource(mistakes=[MistakeResource(field="", sentence=str(error))], told=None)


@router.post("/experiments/from-answers", status_code=201)
def create_from_answers(given: Given, new: NewAnswers, response: Response) -> ExperimentResource:
    """Make an experiment for a rig and a room."""
    _refuse(_mistakes(given, new.answers, None))
    made = add_experiment(given.folders.root, to_toml(new.answers), _room(given, new.answers))
    given.ledger.append_event("experiment", {"experiment": made.folder.name, "created": True})
    return experiment_resource(made, response)


@router.get("/experiments/{experiment}/answers")
def read_answers(given: Given, experiment: Identifier, response: Response) -> AnswersResource:
    """Return an experiment's rig and room as answers: as they were entered, else read from its scene."""
    found = given.folders.open(experiment)
    response.headers.update(etag(found.revision))
    told = answers_of(found)
    return AnswersResource(answers=told.answers, unsaid=list(told.unsaid), revision=found.revision)


@router.put("/experiments/{experiment}/answers")
def put_answers(
    given: Given, experiment: Identifier, new: NewAnswers, response: Response, if_match: IfMatch = None
) -> ExperimentResource:
    """Change an experiment's answers; captures and results stay, and a result keeps the room it was made with."""
    with given.folders.locked(experiment):
        found = given.folders.open(experiment)
        kept = answers_of(found).answers
        check_revision(if_match, {"revision": found.revision, "answers": kept}, {"answers": new.answers})
        _refuse(_mistakes(given, new.answers, kept))
        changed = change_answers(found, new.answers)
    given.ledger.append_event("experiment", {"experiment": experiment, "changed": True})
    return experiment_resource(changed, response)


def _room(given: Services, data: dict[str, Any]) -> Path | None:
    """The room that a simulated camera of these answers looks at; None where nobody has it, or it has none."""
    truth = _truth(data)
    if not isinstance(truth, str) or not truth:
        return None
    return room_of(SAMPLE) if truth == SAMPLE else given.uploads.room(truth)


def _mistakes(given: Services, data: dict[str, Any], kept: dict[str, Any] | None) -> list[Said]:
    """Every mistake; a request names no file of this machine, but may leave what an experiment was made with."""
    truth, before = _truth(data), _truth(kept or {})
    wrong = mistakes_in(data)
    if truth in (None, "") or _room(given, data) is not None if kept is None else truth == before:
        return wrong
    expected = (
        f"expected {SAMPLE!r}, the packaged room, or an uploaded one"
        if kept is None
        else "it cannot be changed afterwards"
    )
    return [*wrong, Said(("camera", "truth"), f"{truth!r} is no room of this service; {expected}.")]


def _truth(data: dict[str, Any]) -> Any:
    camera = data.get("camera")
    return camera.get("truth") if isinstance(camera, dict) else None


def _refuse(wrong: list[Said]) -> None:
    if wrong:
        raise BadInputError("; ".join(f"{field_name(one.path)}: {one.sentence}" for one in wrong))


def _told(settings: ExperimentSettings) -> RoomTold:
    scene = settings.scene
    return RoomTold(
        picture_m=list(picture_on_wall_m(scene)),
        wall_m=list(wall_m(scene)),
        room_m=[list(scene.room.lower_m), list(scene.room.upper_m)],
        supplies=[_supply(n, one) for n, one in enumerate(p for p in scene.boundary if isinstance(p, Inlet))],
        views=[
            ViewTold(
                name=view.name,
                wall=view.wall,
                picture_m=list(picture_on_wall_m(scene, number)),
                wall_m=list(wall_m(scene, number)),
            )
            for number, view in enumerate(scene.views)
            if view.camera_of is None
        ],
        standing=list(_all_standing(scene)),
        settings=to_plain(settings),
    )


def _all_standing(scene: Scene) -> Iterator[StandingResource]:
    """Every camera, and every projector once, with what it covers of its wall."""
    told: list[Light] = []
    for view in scene.views:
        if view.camera_of is None:
            yield _standing("camera", view.name, view.camera, view.wall, scene.room)
        light = view.light or scene.light
        if isinstance(light, ProjectedPattern) and light not in told:
            told.append(light)
            name = (
                view.name
                if view.camera_of
                else "projector"
                if len(told) == 1
                else f"projector of {view.name}"
            )
            yield _standing("projector", name, light.projector, view.wall, scene.room)


def _standing(
    role: Literal["camera", "projector"], name: str, optics: Optics, wall: WallName, room: Box
) -> StandingResource:
    face = face_of(wall)
    on_wall = np.array(room.upper_m if face.upper else room.lower_m)
    return StandingResource(
        name=name,
        role=role,
        position_m=list(optics.position_m),
        corners_m=corners_on(optics, on_wall, -face.inward * np.eye(3)[face.axis]),
    )


def _supply(number: int, inlet: Inlet) -> SupplyTold:
    speed_m_s = sum(part * part for part in inlet.velocity_m_s) ** 0.5
    return SupplyTold(
        field=f"supply[{number}]", speed_m_s=speed_m_s, flow_m3_h=3600 * speed_m_s * inlet.patch.area_m2
    )
