"""The rig's projectors: what each says of itself, what it may be told, and every byte of it."""

import time
from typing import Annotated

from fastapi import APIRouter, Query

from app.api.models.projector import OpenProjector, ProjectorChange, ProjectorResource, WireLine
from app.api.services import Given
from app.api.wire.problems import ApiError
from app.experiment.folder import Experiment
from app.experiment.views import lamp_number
from app.kiosk.screens import MOST
from app.rig.live_projector import ProjectorReport
from app.rig.open import open_projector
from drivers.errors import DeviceRefusedError
from drivers.projector.protocol import Projector

router = APIRouter(tags=["devices"])
ViewNumber = Annotated[
    int, Query(ge=0, lt=MOST, description="Whose projector, by the view's number, from 0.")
]


@router.get("/devices/projector")
def read_projector(given: Given, view: ViewNumber = 0) -> ProjectorResource:
    """Return what a projector said when it was last asked."""
    return projector_resource(given.projectors.there(view).report)


@router.post("/devices/projector/connect")
def connect_projector(given: Given, wanted: OpenProjector) -> ProjectorResource:
    """Speak to the projector of a view of a rig; connecting again opens the line anew.

    The answer's `view` is the first one that sees by it.
    """
    experiment = given.confirmed.check(given.folders.open(wanted.experiment))
    number = lamp_of(experiment, wanted.view)
    report = given.projectors.open(wanted.experiment, number, lambda: open_projector(experiment, number))
    return projector_resource(report)


@router.post("/devices/projector/disconnect")
def disconnect_projector(given: Given, view: ViewNumber = 0) -> ProjectorResource:
    """Free a projector's line, for another program; the lamp stays as it is."""
    return projector_resource(given.projectors.there(view).close())


@router.patch("/devices/projector")
def change_projector(given: Given, change: ProjectorChange) -> ProjectorResource:
    """Switch power, source, mute or freeze; the answer holds what the projector then says."""
    try:
        live = given.projectors.there(change.view)
        return projector_resource(live.command(lambda projector: _apply(projector, change)))
    except DeviceRefusedError as error:
        raise ApiError("conflict", str(error), "Then try again.") from None


@router.get("/devices/projector/wire")
def read_wire(
    given: Given, after_s: Annotated[float, Query(ge=0, le=1e12)] = 0.0, view: ViewNumber = 0
) -> list[WireLine]:
    """List the traffic after a moment (Unix time), oldest first; the latest thousand pieces are kept."""
    return [
        WireLine(at_s=entry.at_s, direction=entry.direction, text=entry.text)
        for entry in given.projectors.there(view).wire
        if entry.at_s > after_s
    ]


def lamp_of(experiment: Experiment, view: int) -> int:
    """The number of the view whose projector lights that view. Raises ApiError where there is no such view."""
    views = len(experiment.settings.scene.views)
    if view >= views:
        raise ApiError("not_found", f"The experiment has {views} views; there is no view {view}.")
    return lamp_number(experiment, view)


def _apply(projector: Projector, change: ProjectorChange) -> None:
    if change.power is not None:
        projector.turn_on() if change.power == "on" else projector.turn_off()
    if change.source is not None:
        projector.select_source(change.source)
    if change.muted is not None:
        projector.mute(change.muted)
    if change.frozen is not None:
        projector.freeze(change.frozen)


def projector_resource(report: ProjectorReport) -> ProjectorResource:
    """Return what the API shows of a projector."""
    said = report.said
    return ProjectorResource(
        view=report.view,
        state=report.state.value,
        experiment=report.source,
        name=said.name if said else None,
        source=said.source if said else None,
        muted=said.muted if said else None,
        frozen=said.frozen if said else None,
        lamp_hours=said.lamp_hours if said else None,
        lamp_on_s=said.on_s if said else None,
        for_s=max(0.0, time.time() - report.since_s) if report.since_s else None,
        errors=list(said.errors) if said else [],
        capabilities=list(report.capabilities),
        reason=report.reason,
    )
