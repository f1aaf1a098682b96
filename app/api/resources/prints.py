"""PDFs at true scale: the wall's pattern, and boards to calibrate with."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse

from app.api.models.prints import NewBoard, NewPattern, PrintedResource
from app.api.services import Given
from app.api.wire.board import board_settings
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.experiment.folder import Experiment
from app.experiment.printed import Printed, is_of_the_scene, name_of, read_printed
from app.experiment.views import lamp_number, printed_walls, view_number

router = APIRouter(tags=["prints"])
What = Literal["pattern", "board"]
ViewName = Annotated[str | None, Query(max_length=200, description="Whose wall, by the view's name.")]
PDF = body("application/pdf", "Sheets at true scale: print them at 100 %.")


@router.get("/experiments/{experiment}/prints")
def list_prints(given: Given, experiment: Identifier) -> list[PrintedResource]:
    """List what was printed: each wall's pattern, the board."""
    found = given.folders.open(experiment)
    records = [read_printed(found, "pattern", number) for number in printed_walls(found)]
    records.append(read_printed(found, "board"))
    return [_resource(one, found) for one in records if one is not None]


@router.post("/experiments/{experiment}/prints/pattern", status_code=201)
def print_pattern(given: Given, experiment: Identifier, new: NewPattern) -> PrintedResource:
    """Make the PDF of the wall's pattern."""
    # Imported here: what draws sheets takes a second to load.
    from app.sheets.pattern import choose_pattern
    from app.sheets.pattern import print_pattern as made

    found = given.folders.open(experiment)
    if new.choose:
        found = choose_pattern(found.folder, new.view)
    _, printed = made(found, new.paper, overlap_m=new.overlap_m, view=new.view)
    given.ledger.append_event("experiment", {"experiment": experiment, "changed": True})
    return _resource(printed, found)


@router.post("/experiments/{experiment}/prints/board", status_code=201)
def print_board(given: Given, experiment: Identifier, new: NewBoard) -> PrintedResource:
    """Make the PDF of a board; it becomes the rig's where the rig names none."""
    from app.sheets.board import print_board as made
    from app.sheets.board import remember_board, suited_board

    found = given.folders.open(experiment)
    own = None if new.board is None else board_settings(new.board)
    settings = own or found.settings.rig.board or suited_board(new.paper)
    _, printed = made(settings, new.paper, experiment=found)
    remember_board(found, settings)
    given.ledger.append_event("experiment", {"experiment": experiment, "changed": True})
    if printed is None:
        raise ApiError("not_found", "The board was not kept.", "Print it again.")
    return _resource(printed, found)


@router.get("/experiments/{experiment}/prints/{what}/pdf", response_class=Response, responses=PDF)
def read_print(given: Given, experiment: Identifier, what: What, view: ViewName = None) -> Response:
    """Return the PDF that was made last; of a pattern, for the wall of a view (by default the first one's)."""
    found = given.folders.open(experiment)
    number = 0 if view is None or what == "board" else lamp_number(found, view_number(found, view))
    printed = read_printed(found, what, number)
    if printed is None:
        raise ApiError("not_found", f"No {what} was printed for {experiment!r}.", "Make the PDF first.")
    name = f"{found.folder.name}-{name_of(what, printed.view)}.pdf"
    return FileResponse(found.file(printed.file), media_type="application/pdf", filename=name)


def _resource(printed: Printed, experiment: Experiment) -> PrintedResource:
    return PrintedResource(
        view=printed.view,
        what=printed.what,
        paper=printed.paper,
        sheets=list(printed.sheets),
        width_m=printed.width_m,
        height_m=printed.height_m,
        finest_period_m=printed.finest_period_m,
        finest_period_camera_px=printed.finest_period_camera_px,
        created=printed.created,
        is_of_the_scene=printed.what == "board" or is_of_the_scene(printed, experiment),
    )
