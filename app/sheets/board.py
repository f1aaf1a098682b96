"""A board to calibrate with, on one sheet: what `airlens calibrate` is then told of it is what was printed."""

from pathlib import Path

import cv2
import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment, open_experiment, save_settings
from app.experiment.printed import PRINT_FOLDER, Printed
from app.experiment.rig_settings import BoardSettings
from app.files.lock import locked
from app.files.toml import to_plain
from app.sheets.drawing import Sheets
from app.sheets.paper import Paper, papers_of
from app.sheets.record import keep_record, version, write_sheets
from calibration.board import Board, CharucoBoard

# Print pixels along a square: at least, at most.
_PX_A_SQUARE = (100, 400)


def largest_square_m(settings: BoardSettings, paper: str) -> float:
    """The largest square, in whole millimetres, with which this board fits the paper. Raises BadInputError."""
    width, height = _squares(settings)
    fitting = [min(one.area_m[0] / width, one.area_m[1] / height) for one in papers_of(paper)]
    return int(1e3 * max(fitting) + 1e-6) / 1e3


def suited_board(paper: str) -> BoardSettings:
    """A ChArUco board of 9 x 6 squares, as large as fits the paper. Raises BadInputError."""
    unit = BoardSettings(kind="charuco", columns=9, rows=6, square_m=1.0)
    return unit.model_copy(update={"square_m": largest_square_m(unit, paper)})


def print_board(
    settings: BoardSettings, paper: str, out: Path | None = None, experiment: Experiment | None = None
) -> tuple[Path, Printed | None]:
    """Write the board as a PDF; an experiment keeps the record. Raises BadInputError: it is larger than the paper."""
    board = settings.board()
    sheet = _fitting(settings, paper)
    px = _px_per_square(board)
    picture = board.draw(px)
    pixel_m = settings.square_m / px
    folder = Path() if experiment is None else experiment.folder / PRINT_FOLDER
    path = out or folder / f"board-{sheet.name}.pdf"
    footer = (
        f"airlens {version()}: {_told(settings, board)}, scale 1:1, on {sheet.name}.",
        _calibrate(settings),
    )
    digest = write_sheets(
        path, "airlens: board", lambda sheets: _page(sheets, sheet, picture, pixel_m, footer)
    )
    if experiment is None:
        return path, None
    rows, cols = picture.shape
    return path, keep_record(
        experiment,
        path,
        digest,
        what="board",
        content=to_plain(settings),
        width_m=cols * pixel_m,
        height_m=rows * pixel_m,
        paper=sheet.name,
        sheets=(1, 1),
        overlap_m=0.0,
        print_pixel_m=pixel_m,
    )


def remember_board(experiment: Experiment, settings: BoardSettings) -> bool:
    """Make it the rig's board where the rig names none; returns whether it did."""
    with locked(experiment.folder):
        now = open_experiment(experiment.folder)
        if now.settings.rig.board is not None:
            return False
        rig = now.settings.rig.model_copy(update={"board": settings})
        save_settings(now.folder, now.settings.model_copy(update={"rig": rig}))
    return True


def _page(sheets: Sheets, paper: Paper, picture: np.ndarray, pixel_m: float, footer: tuple[str, str]) -> None:
    sheets.add(paper, picture, pixel_m, footer)


def _fitting(settings: BoardSettings, paper: str) -> Paper:
    width_m, height_m = (settings.square_m * squares for squares in _squares(settings))
    for one in papers_of(paper):
        if width_m <= one.area_m[0] + 1e-6 and height_m <= one.area_m[1] + 1e-6:
            return one.cut(height_m)
    least_mm = 1e3 * largest_square_m(settings, paper)
    raise BadInputError(
        f"The board is {1e3 * width_m:.0f} x {1e3 * height_m:.0f} mm with its white margin, larger than {paper}; "
        f"its squares may be {least_mm:g} mm there (--square {least_mm:g}mm)."
    )


def _squares(settings: BoardSettings) -> tuple[float, float]:
    """Width and height of the drawn board in squares, its margin included."""
    marker_m = None if settings.marker_m is None else settings.marker_m / settings.square_m
    unit = settings.model_copy(update={"square_m": 1.0, "marker_m": marker_m}).board()
    px = 20
    rows, cols = unit.draw(px).shape
    return cols / px, rows / px


def _px_per_square(board: Board) -> int:
    """So many print pixels that a marker's cells are whole ones, or nearly."""
    low, high = _PX_A_SQUARE
    if not isinstance(board, CharucoBoard):
        return 2 * low
    cells = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary)).markerSize + 2
    share = board.marker_m / board.square_m

    def wrong(px: int) -> float:
        cell = px * share / cells
        edge = (px - px * share) / 2
        return abs(cell - round(cell)) + abs(edge - round(edge))

    return min(range(low, high + 1), key=lambda px: (round(wrong(px), 6), px))


def _told(settings: BoardSettings, board: Board) -> str:
    size = f"{settings.kind} {settings.columns} x {settings.rows}, squares of {1e3 * settings.square_m:g} mm"
    if isinstance(board, CharucoBoard):
        return f"{size}, markers of {1e3 * board.marker_m:g} mm, {board.dictionary}"
    return size


def _calibrate(settings: BoardSettings) -> str:
    """The options that tell `airlens calibrate` of this board."""
    marker = f" --marker {1e3 * settings.marker_m:g}mm" if settings.marker_m else ""
    return (
        f"airlens calibrate camera EXPERIMENT --board {settings.kind} --grid {settings.columns}x{settings.rows} "
        f"--square {1e3 * settings.square_m:g}mm{marker}"
    )
