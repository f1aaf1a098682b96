"""What was printed for an experiment, as it is kept: `print/pattern.json` and `print/board.json`.

Another view's wall has its own pattern: `print/pattern-VIEW.json`.
"""

from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import quote

from app.files.reading import read_json
from app.files.toml import Strict, parse, to_plain

if TYPE_CHECKING:
    from app.experiment.folder import Experiment

PRINT_FOLDER = "print"


class Printed(Strict):
    """A PDF of sheets: what is on them, at which size, and the file that holds them.

    `content` is the wall's light (a pattern with its seed and the size of its pixels), or the rig's board. `view` is
    whose wall's pattern it is, where that is not the first one's.
    """

    schema_version: Literal[1] = 1
    what: Literal["pattern", "board"]
    view: str | None = None
    content: dict[str, Any]
    width_m: float
    height_m: float
    finest_period_m: float | None = None
    finest_period_camera_px: float | None = None
    paper: str
    sheets: tuple[int, int]
    overlap_m: float
    print_pixel_m: float
    file: str
    sha256: str
    version: str
    created: str


def name_of(what: Literal["pattern", "board"], view: str | None = None) -> str:
    """What the record and the sheets are called: a view that is not the first one is named."""
    return what if view is None else f"{what}-{quote(view, safe=' ()+,@')}"


def record_name(what: Literal["pattern", "board"], view: str | None = None) -> str:
    """Where the record lies in the experiment's folder."""
    return f"{PRINT_FOLDER}/{name_of(what, view)}.json"


def read_printed(
    experiment: "Experiment", what: Literal["pattern", "board"], view: int = 0
) -> Printed | None:
    """What was printed last (of patterns, for a view's wall), or None. Raises BadInputError for what is no record."""
    path = experiment.folder / record_name(what, named(experiment, view))
    if not path.is_file():
        return None
    return parse(read_json(path, "Print again: `airlens print`."), Printed, str(path))


def named(experiment: "Experiment", view: int) -> str | None:
    """A view's name where it is not the first one."""
    return None if view == 0 else experiment.settings.scene.views[view].name


def is_of_the_scene(printed: Printed, experiment: "Experiment") -> bool:
    """Whether the printed pattern is its view's, as it stands now."""
    scene = experiment.settings.scene
    views = [view for view in scene.views if view.name == printed.view] or list(scene.views[:1])
    return printed.content == to_plain(views[0].light or scene.light)
