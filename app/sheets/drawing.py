"""Pages at true scale: a picture, the marks to put sheets together by, a scale bar, a footer.

A PDF's unit is 1/72 inch; pictures are kept without loss, one byte a print pixel. What a printer's own settings do to
the scale ("fit to page") nobody can know, hence the bar to hold a ruler to.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jaxtyping import UInt8
from numpy import ndarray
from PIL import Image
from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.lib.utils import ImageReader
from reportlab.pdfgen.canvas import Canvas

from app.sheets.paper import FOOTER_M, MARGIN_M, Layout, Paper, Tile

BAR_M = 0.1
_M = 1000 * mm
_MARK_M = (0.001, 0.005)
_TEXT_PT = 6.5


@dataclass(frozen=True)
class Shared:
    """How far each neighbour's picture reaches into this one [m]; 0 where there is no neighbour."""

    left_m: float = 0.0
    right_m: float = 0.0
    top_m: float = 0.0
    bottom_m: float = 0.0


def shared_by(layout: Layout, tile: Tile, pixel_m: float) -> Shared:
    """How far the neighbours reach into this tile; a print pixel's edge is `pixel_m`."""
    by_place = {(one.row, one.col): one for one in layout.tiles}

    def shared_m(row: int, col: int) -> float:
        other = by_place.get((tile.row + row, tile.col + col))
        if other is None:
            return 0.0
        mine, its = (tile.rows, other.rows) if row else (tile.cols, other.cols)
        return (min(mine.stop, its.stop) - max(mine.start, its.start)) * pixel_m

    return Shared(shared_m(0, -1), shared_m(0, 1), shared_m(-1, 0), shared_m(1, 0))


class Sheets:
    """A PDF that grows by a page at a time; a page's picture is packed and let go when it is drawn."""

    def __init__(self, path: Path, title: str) -> None:
        # Pictures as they are packed, not as text: a quarter smaller.
        rl_config.useA85 = 0
        self._canvas = Canvas(str(path), invariant=1)
        self._canvas.setTitle(title)
        self._canvas.setCreator("airlens")

    def add(
        self,
        paper: Paper,
        picture: UInt8[ndarray, "rows cols"],
        pixel_m: float,
        footer: Sequence[str],
        shared: Shared | None = None,
    ) -> None:
        """Add a page; the picture stands on the footer, at the left margin, or in the middle where it is alone."""
        canvas, (rows, cols) = self._canvas, picture.shape
        canvas.setPageSize((paper.width_m * _M, paper.height_m * _M))
        width_m, height_m = cols * pixel_m, rows * pixel_m
        x_m, y_m = MARGIN_M if shared else (paper.width_m - width_m) / 2, FOOTER_M
        reader = ImageReader(Image.fromarray(picture))
        canvas.drawImage(reader, x_m * _M, y_m * _M, width_m * _M, height_m * _M)
        if shared is not None:
            self._marks(x_m, y_m, width_m, height_m, shared)
        self._footer(footer)
        canvas.showPage()

    def save(self) -> None:
        """Write the file."""
        self._canvas.save()

    def _marks(self, x_m: float, y_m: float, width_m: float, height_m: float, shared: Shared) -> None:
        """Ticks in the margin: where the picture ends, and where the neighbours' pictures end in it."""
        right_m, top_m = x_m + width_m, y_m + height_m
        across = {x_m, right_m, x_m + shared.left_m, right_m - shared.right_m}
        up = {y_m, top_m, y_m + shared.bottom_m, top_m - shared.top_m}
        near_m, far_m = _MARK_M
        for at_m in across:
            for start_m, way in ((top_m, 1), (y_m, -1)):
                self._line(at_m, start_m + way * near_m, at_m, start_m + way * far_m)
        for at_m in up:
            for start_m, way in ((right_m, 1), (x_m, -1)):
                self._line(start_m + way * near_m, at_m, start_m + way * far_m, at_m)

    def _line(self, x0_m: float, y0_m: float, x1_m: float, y1_m: float, width_pt: float = 0.25) -> None:
        self._canvas.setLineWidth(width_pt)
        self._canvas.line(x0_m * _M, y0_m * _M, x1_m * _M, y1_m * _M)

    def _footer(self, lines: Sequence[str]) -> None:
        """The bar from the margin on, its ends and centimetres; the footer's lines below it."""
        base_m = FOOTER_M - 0.009
        self._line(MARGIN_M, base_m, MARGIN_M + BAR_M, base_m, 0.5)
        for tick in range(11):
            height_m = 0.003 if tick in (0, 10) else 0.0015
            at_m = MARGIN_M + tick * BAR_M / 10
            self._line(at_m, base_m, at_m, base_m + height_m)
        self._canvas.setFont("Helvetica", _TEXT_PT)
        told = "100 mm: hold a ruler to it. Print at 100 %, without fitting to the page."
        self._canvas.drawString((MARGIN_M + BAR_M + 0.003) * _M, base_m * _M, told)
        for number, line in enumerate(lines):
            self._canvas.drawString(MARGIN_M * _M, (base_m - 0.0035 - 0.003 * number) * _M, line)
