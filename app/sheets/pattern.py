"""A wall's printed pattern as sheets of paper: the very luminance that the simulator renders.

The scene describes each pattern in pixels of `pixel_m`, and the renderer reads between them by a cubic spline. So do
the sheets, in print pixels of at most half a millimetre; grey 0 to 255 is luminance 0 to 1.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8
from scipy.interpolate import BSpline
from scipy.ndimage import spline_filter

from app.errors import BadInputError
from app.experiment.folder import Experiment, open_experiment, save_settings
from app.experiment.printed import PRINT_FOLDER, Printed, name_of, named
from app.experiment.views import lamp_number, printed_walls, view_number
from app.files.lock import locked
from app.files.toml import to_plain
from app.sheets.drawing import Sheets, shared_by
from app.sheets.paper import Layout, Tile, laid_out
from app.sheets.record import keep_record, version, write_sheets
from core.pattern import pattern_parts
from core.plan.print_choice import (
    LEAST_PERIOD_PX,
    coarsest,
    finest_period_m,
    period_in_camera_px,
    suited_print,
)
from core.render.light import texture_size
from core.scene import CheckerPattern, FixedTexture, Scene
from core.view_frame import facing

_PRINT_PIXEL_M = 0.0005
# A cubic spline's coefficients forget what is so many pixels away, to 1e-9.
_MARGIN_PX = 16
_STRIP_PIXELS = 2**22
OnSheet = Callable[[int, int], object]


@dataclass(frozen=True)
class PrintPattern:
    """A pattern in print pixels, `fine` of them along each pattern pixel; any rectangle can be made."""

    light: FixedTexture
    rows: int
    cols: int
    fine: int
    part: Callable[[slice, slice], Float32[np.ndarray, "_ _"]]

    @property
    def print_pixel_m(self) -> float:
        """Edge of a print pixel."""
        return self.light.pixel_m / self.fine

    @property
    def size_px(self) -> tuple[int, int]:
        """Rows and columns in print pixels."""
        return self.rows * self.fine, self.cols * self.fine

    def picture(self, rows: slice, cols: slice) -> UInt8[np.ndarray, "_ _"]:
        """A rectangle of print pixels, made in strips."""
        width = cols.stop - cols.start
        grey = np.empty((rows.stop - rows.start, width), np.uint8)
        step = max(1, _STRIP_PIXELS // width)
        for first in range(rows.start, rows.stop, step):
            last = min(first + step, rows.stop)
            strip = self._luminance(slice(first, last), cols)
            grey[first - rows.start : last - rows.start] = np.rint(255 * np.clip(strip, 0.0, 1.0))
        return grey

    def _luminance(self, rows: slice, cols: slice) -> np.ndarray:
        wanted = (rows, cols)
        own = [
            slice(max(0, one.start // self.fine - _MARGIN_PX), min(n, -(-one.stop // self.fine) + _MARGIN_PX))
            for one, n in zip(wanted, (self.rows, self.cols), strict=True)
        ]
        values = self.part(*own)
        if self.fine == 1:
            first, second = (
                slice(one.start - mine.start, one.stop - mine.start)
                for one, mine in zip(wanted, own, strict=True)
            )
            return values[first, second]
        weights = np.pad(spline_filter(values, order=3, mode="mirror"), 2, mode="reflect")
        # The middle of print pixel i lies at (i + 0.5) / fine - 0.5 pattern pixels.
        places = (
            (np.arange(one.start, one.stop) + 0.5) / self.fine - 0.5 - mine.start
            for one, mine in zip(wanted, own, strict=True)
        )
        # One axis after the other: eight products a pixel instead of sixteen.
        down, across = (
            BSpline.design_matrix(place, np.arange(count + 4.0) - 4.0, 3)
            for place, count in zip(places, weights.shape, strict=True)
        )
        return (across @ (down @ weights).T).T


def choose_pattern(folder: Path, view: str | None = None) -> Experiment:
    """Give a view (by default the first) the finest print that suits its light's coarsest camera, of the same seed.

    Raises BadInputError.
    """
    with locked(folder):
        experiment = open_experiment(folder)
        number, scene = _number(experiment, view), experiment.settings.scene
        own, before = scene.views[number].light, _print_of(scene, number)
        camera, room = coarsest(scene, number)
        distance_m = room.upper_m[1] - camera.position_m[1]
        light = suited_print(camera, distance_m, getattr(before.pattern, "seed", 0))
        if own is None:
            scene = replace(scene, light=light)
        else:
            views = tuple(replace(one, light=light) if one.light == own else one for one in scene.views)
            scene = replace(scene, views=views)
        return save_settings(folder, experiment.settings.model_copy(update={"scene": scene}))


def print_pattern_of(scene: Scene, view: int = 0) -> PrintPattern:
    """The print of a view's wall. Raises BadInputError: a projector lights it, or the camera cannot see it."""
    light = _print_of(scene, view)
    period_px = period_in_camera_px(light, scene, view)
    if period_px < LEAST_PERIOD_PX * (1 - 1e-6):
        raise BadInputError(
            f"The pattern's finest period is {1e3 * finest_period_m(light):.3g} mm, {period_px:.2g} pixels of the "
            f"camera; expected {LEAST_PERIOD_PX:g} at least. Set {_place(scene, view)}.pixel_m = "
            f"{light.pixel_m * LEAST_PERIOD_PX / period_px:.3g} in experiment.toml, or give --choose."
        )
    rows, cols = texture_size(facing(scene, view)[0].room, light.pixel_m)
    fine = max(1, math.ceil(light.pixel_m / _PRINT_PIXEL_M - 1e-9))
    return PrintPattern(light, rows, cols, fine, pattern_parts(light.pattern, rows, cols))


def _print_of(scene: Scene, view: int) -> FixedTexture:
    light = scene.views[view].light or scene.light
    if isinstance(light, FixedTexture):
        return light
    whose = "of this experiment" if len(scene.views) == 1 else f"of {scene.views[view].name!r}"
    raise BadInputError(
        f"The light {whose} is a projector: there is nothing to print. Boards are printed by "
        "`airlens print board`."
    )


def _place(scene: Scene, view: int) -> str:
    """Where experiment.toml has a view's light."""
    return "scene.light" if scene.views[view].light is None else f"scene.views[{view}].light"


def _number(experiment: Experiment, view: str | None) -> int:
    """The view that stands for a wall's print: the first one that sees by it. Raises BadInputError."""
    return 0 if view is None else lamp_number(experiment, view_number(experiment, view))


def print_pattern(
    experiment: Experiment,
    paper: str,
    out: Path | None = None,
    overlap_m: float = 0.01,
    on_sheet: OnSheet = lambda done, total: None,
    view: str | None = None,
) -> tuple[Path, Printed]:
    """Write the pattern of a view's wall (by default the first one's) as a PDF, and what was printed into the
    experiment. Raises BadInputError."""
    scene, number = experiment.settings.scene, _number(experiment, view)
    pattern, of = print_pattern_of(scene, number), named(experiment, number)
    layout = laid_out(*pattern.size_px, pattern.print_pixel_m, paper, overlap_m)
    path = out or experiment.folder / PRINT_FOLDER / f"{name_of('pattern', of)}-{layout.paper.name}.pdf"
    period_px = period_in_camera_px(pattern.light, scene, number)

    wall = scene.views[number].wall if len(printed_walls(experiment)) > 1 else ""

    def draw(sheets: Sheets) -> None:
        for number, tile in enumerate(layout.tiles, 1):
            picture = pattern.picture(tile.rows, tile.cols)
            footer = _footer(pattern, layout, tile, period_px, wall)
            shared = shared_by(layout, tile, pattern.print_pixel_m)
            sheets.add(layout.paper, picture, pattern.print_pixel_m, footer, shared)
            on_sheet(number, len(layout.tiles))

    digest = write_sheets(path, f"airlens: pattern of {experiment.folder.name}", draw)
    rows, cols = pattern.size_px
    return path, keep_record(
        experiment,
        path,
        digest,
        what="pattern",
        view=of,
        content=to_plain(pattern.light),
        width_m=cols * pattern.print_pixel_m,
        height_m=rows * pattern.print_pixel_m,
        finest_period_m=finest_period_m(pattern.light),
        finest_period_camera_px=period_px,
        paper=layout.paper.name,
        sheets=layout.sheets,
        overlap_m=overlap_m,
        print_pixel_m=pattern.print_pixel_m,
    )


def _footer(
    pattern: PrintPattern, layout: Layout, tile: Tile, period_px: float, wall: str
) -> tuple[str, str]:
    kind = pattern.light.pattern
    seed = "" if isinstance(kind, CheckerPattern) else f", seed {kind.seed}"
    rows, cols = layout.sheets
    on = f"Wall {wall}: row" if wall else "Row"
    return (
        f"airlens {version()}: {kind.kind}{seed}, scale 1:1, pattern pixel {1e3 * pattern.light.pixel_m:.4g} mm, "
        f"finest period {1e3 * finest_period_m(pattern.light):.3g} mm = {period_px:.2g} camera px",
        f"{on} {tile.row} of {rows} from the top, column {tile.col} of {cols} from the left, on {layout.paper.name}. "
        "Inner marks: the next sheet's picture ends there.",
    )
