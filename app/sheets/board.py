"""A board to calibrate with: what `airlens calibrate` is then told of it is what was printed.

A board that is larger than the paper is laid over several sheets, with marks to put them together by.
"""

from pathlib import Path

import cv2
import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment, open_experiment, save_settings
from app.experiment.printed import PRINT_FOLDER, Printed
from app.experiment.rig_settings import BoardSettings
from app.files.lock import locked
from app.files.toml import to_plain
from app.sheets.drawing import Sheets, shared_by
from app.sheets.paper import Layout, Tile, laid_out, papers_of
from app.sheets.record import keep_record, version, write_sheets
from calibration.board import Board, CharucoBoard

# Print pixels along a square: at least, at most.
_PX_A_SQUARE = (100, 400)
# So many sheets are put together by hand, and no more.
_MOST_SHEETS = 40
# What neighbouring sheets share.
_OVERLAP_M = 0.01


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
    """Write the board as a PDF; an experiment keeps the record. Raises BadInputError: it needs too many sheets."""
    board = settings.board()
    px = _px_per_square(board)
    pixel_m = settings.square_m / px
    layout = board_layout(settings, paper)
    name = layout.paper.name
    folder = Path() if experiment is None else experiment.folder / PRINT_FOLDER
    path = out or folder / f"board-{name}.pdf"
    picture = board.draw(px)
    told = f"airlens {version()}: {_told(settings, board)}, scale 1:1, on {name}"

    def draw(sheets: Sheets) -> None:
        for tile in layout.tiles:
            part = np.ascontiguousarray(picture[tile.rows, tile.cols])
            footer = (f"{told}{_place(layout, tile)}.", _calibrate(settings))
            alone = len(layout.tiles) == 1
            sheets.add(
                layout.paper, part, pixel_m, footer, None if alone else shared_by(layout, tile, pixel_m)
            )

    digest = write_sheets(path, "airlens: board", draw)
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
        paper=name,
        sheets=layout.sheets,
        overlap_m=0.0 if len(layout.tiles) == 1 else _OVERLAP_M,
        print_pixel_m=pixel_m,
    )


def board_layout(settings: BoardSettings, paper: str) -> Layout:
    """The sheets that the board is printed on. Raises BadInputError: they are too many."""
    squares = _squares(settings)
    width_m, height_m = (settings.square_m * count for count in squares)
    largest = max(one.area_m[0] * one.area_m[1] for one in papers_of(paper))
    px = _px_per_square(settings.board())
    if width_m * height_m <= _MOST_SHEETS * largest:
        rows, cols = (round(px * count) for count in reversed(squares))
        layout = laid_out(rows, cols, settings.square_m / px, paper, _OVERLAP_M)
        if len(layout.tiles) <= _MOST_SHEETS:
            return layout
    least_mm = 1e3 * largest_square_m(settings, paper)
    raise BadInputError(
        f"The board is {1e3 * width_m:.0f} x {1e3 * height_m:.0f} mm with its white margin, more than "
        f"{_MOST_SHEETS} sheets of {paper}. Take larger paper; on one sheet of {paper} its squares may be "
        f"{least_mm:g} mm (--square {least_mm:g}mm)."
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


def _place(layout: Layout, tile: Tile) -> str:
    """Which sheet this is, where there are several."""
    if len(layout.tiles) == 1:
        return ""
    rows, cols = layout.sheets
    return f", row {tile.row} of {rows} from the top, column {tile.col} of {cols} from the left"


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
