"""Paper: its sizes, and a picture laid out over sheets that overlap. Lengths in metres, tiles in print pixels."""

import math
import re
from dataclasses import dataclass

from app.errors import BadInputError

# Short and long side [m] (ISO 216).
PAPERS = {
    "a4": (0.210, 0.297),
    "a3": (0.297, 0.420),
    "a2": (0.420, 0.594),
    "a1": (0.594, 0.841),
    "a0": (0.841, 1.189),
}
# What is left white around the picture; the lower edge holds the scale bar and the footer.
MARGIN_M = 0.010
FOOTER_M = 0.026
# A page of a PDF is at most 14400 points long.
_LONGEST_M = 5.0
_ROLL_M = (0.2, 3.3)


@dataclass(frozen=True)
class Paper:
    """A sheet, or a roll: then `height_m` is the longest piece that is cut off it."""

    name: str
    width_m: float
    height_m: float
    roll: bool = False

    @property
    def area_m(self) -> tuple[float, float]:
        """Width and height that can carry a picture."""
        return self.width_m - 2 * MARGIN_M, self.height_m - MARGIN_M - FOOTER_M

    def cut(self, picture_height_m: float) -> "Paper":
        """The piece of the roll that holds a picture of this height; a sheet stays as it is."""
        height_m = picture_height_m + MARGIN_M + FOOTER_M if self.roll else self.height_m
        return Paper(self.name, self.width_m, height_m, self.roll)


@dataclass(frozen=True)
class Tile:
    """One sheet's part of the picture: its place among the sheets (from 1) and its print pixels."""

    row: int
    col: int
    rows: slice
    cols: slice


@dataclass(frozen=True)
class Layout:
    """A picture over sheets of one size; neighbours share `overlap_px` at least."""

    paper: Paper
    tiles: tuple[Tile, ...]
    sheets: tuple[int, int]


def papers_of(name: str) -> tuple[Paper, ...]:
    """The ways to lay a paper: upright and across; a roll one way. Raises BadInputError for an unknown name."""
    if name.lower() in PAPERS:
        short_m, long_m = PAPERS[name.lower()]
        return Paper(name.lower(), short_m, long_m), Paper(name.lower(), long_m, short_m)
    roll = re.fullmatch(r"(\d+(?:\.\d+)?)\s*mm", name)
    if roll is None:
        raise BadInputError(
            f"There is no paper {name!r}; there are {', '.join(PAPERS)}, and rolls by their width, such as 841mm."
        )
    width_m = float(roll[1]) / 1e3
    if not _ROLL_M[0] <= width_m <= _ROLL_M[1]:
        raise BadInputError(
            f"A roll of {name} was asked for; expected {1e3 * _ROLL_M[0]:g} to {1e3 * _ROLL_M[1]:g} mm."
        )
    return (Paper(name, width_m, _LONGEST_M, roll=True),)


def laid_out(rows: int, cols: int, pixel_m: float, paper: str, overlap_m: float) -> Layout:
    """The picture on the fewest sheets. Raises BadInputError: no such paper, an overlap that fills it."""
    found = [_layout(rows, cols, pixel_m, one, overlap_m) for one in papers_of(paper)]
    return min(found, key=lambda layout: len(layout.tiles))


def _layout(rows: int, cols: int, pixel_m: float, paper: Paper, overlap_m: float) -> Layout:
    if not 0 <= overlap_m < 0.4 * min(paper.area_m):
        raise BadInputError(
            f"The overlap is {1e3 * overlap_m:g} mm; expected 0 to {400 * min(paper.area_m):.0f} mm on {paper.name}."
        )
    across, down = (
        _parts(total, math.floor(room_m / pixel_m + 1e-6), math.ceil(overlap_m / pixel_m - 1e-6))
        for total, room_m in zip((cols, rows), paper.area_m, strict=True)
    )
    tiles = tuple(Tile(r, c, row, col) for r, row in enumerate(down, 1) for c, col in enumerate(across, 1))
    height_m = max(row.stop - row.start for row in down) * pixel_m
    return Layout(paper.cut(height_m), tiles, (len(down), len(across)))


def _parts(total: int, room: int, overlap: int) -> list[slice]:
    """Equal parts (but for a pixel) of at most `room` that overlap."""
    if room <= overlap + 1:
        raise BadInputError(
            "A pattern pixel is as large as the paper. Take larger paper, or check pixel_m in metres."
        )
    count = max(1, math.ceil((total - overlap) / (room - overlap)))
    size = min(total, math.ceil((total + (count - 1) * overlap) / count))
    starts = [round(n * (total - size) / max(count - 1, 1)) for n in range(count)]
    return [slice(start, start + size) for start in starts]
