"""What was printed for an experiment, as it is kept: `print/pattern.json` and `print/board.json`."""

from typing import TYPE_CHECKING, Any, Literal

from app.files.reading import read_json
from app.files.toml import Strict, parse, to_plain

if TYPE_CHECKING:
    from app.experiment.folder import Experiment

PRINT_FOLDER = "print"


class Printed(Strict):
    """A PDF of sheets: what is on them, at which size, and the file that holds them.

    `content` is the scene's light (a pattern with its seed and the size of its pixels), or the rig's board.
    """

    schema_version: Literal[1] = 1
    what: Literal["pattern", "board"]
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


def record_name(what: Literal["pattern", "board"]) -> str:
    """Where the record lies in the experiment's folder."""
    return f"{PRINT_FOLDER}/{what}.json"


def read_printed(experiment: "Experiment", what: Literal["pattern", "board"]) -> Printed | None:
    """What was printed last, or None. Raises BadInputError for a file that is no record."""
    path = experiment.folder / record_name(what)
    if not path.is_file():
        return None
    return parse(read_json(path, "Print again: `airlens print`."), Printed, str(path))


def is_of_the_scene(printed: Printed, experiment: "Experiment") -> bool:
    """Whether the printed pattern is the scene's, as it stands now, on the wall that it has now."""
    scene = experiment.settings.scene
    return printed.content == to_plain(scene.light)
