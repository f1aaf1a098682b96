"""Figures of the report: one function a picture, drawn with Matplotlib's object interface, no global state."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from app.experiment.found import Found
from core.comfort import CELSIUS_K
from core.geometry import Vector3
from core.problem import ShiftMeasurement
from core.result import Solution

# Perceptually even and safe for colour-blind eyes.
SEQUENTIAL, DIVERGING = "viridis", "RdBu_r"
# Cold and warm as people think of them.
AIR = "RdYlBu_r"
# An outline that is told from grey by its lightness as well.
_MARK = "#ff7f0e"


@dataclass(frozen=True)
class FloorMap:
    """A map seen from above, of values at vertices.

    `ends` of its scale: from zero to the largest value without them. `marks` are values of the scale with a word.
    """

    title: str
    label: str
    x_m: np.ndarray
    y_m: np.ndarray
    values: np.ndarray
    ends: tuple[float, float] | None = None
    colours: str = SEQUENTIAL
    marks: tuple[tuple[float, str], ...] = ()


def as_png(figure: Figure, dpi: int = 110) -> bytes:
    """The figure as a PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


def as_data_uri(figure: Figure) -> str:
    """The figure as an address for an `img` element of an offline page."""
    return "data:image/png;base64," + base64.b64encode(as_png(figure)).decode("ascii")


def images_figure(reference: np.ndarray, flow: np.ndarray) -> Figure:
    """Reference, flow, and their difference, which is all that the eye can be shown of it."""
    tall_in = 3.9 * reference.shape[0] / reference.shape[1] + 0.4
    figure = Figure(figsize=(13, tall_in), layout="constrained")
    axes = figure.subplots(1, 3)
    step = max(1, reference.shape[1] // 800)
    small = [image[::step, ::step] for image in (reference, flow)]
    high = float(np.percentile(small[0], 99.5))
    for axis, image, title in zip(axes, small, ("reference image", "flow image"), strict=False):
        axis.imshow(image, cmap="gray", vmin=0, vmax=high)
        axis.set_title(title)
    difference = small[1] - small[0]
    limit = float(np.percentile(np.abs(difference), 99)) or 1e-6
    drawn = axes[2].imshow(difference, cmap=DIVERGING, vmin=-limit, vmax=limit)
    axes[2].set_title("flow minus reference")
    figure.colorbar(drawn, ax=axes[2], label="part of full scale", shrink=0.85)
    for axis in axes:
        axis.set_axis_off()
    return figure


def found_figure(reference: np.ndarray, things: Sequence[Found]) -> Figure:
    """The reference with an outline and its name for each thing that was found in it."""
    figure = Figure(figsize=(9, 9 * reference.shape[0] / reference.shape[1]), layout="constrained")
    axis = figure.subplots()
    step = max(1, reference.shape[1] // 1200)
    axis.imshow(
        reference[::step, ::step],
        cmap="gray",
        vmin=0,
        vmax=float(np.percentile(reference, 99.5)),
        extent=(-0.5, reference.shape[1] - 0.5, reference.shape[0] - 0.5, -0.5),
    )
    for one in things:
        left, top, right, bottom = one.outline_px
        axis.add_patch(Rectangle((left, top), right - left, bottom - top, fill=False, lw=2, edgecolor=_MARK))
        axis.annotate(
            one.box.name, (0.5 * (left + right), top), (0, 4), textcoords="offset points", ha="center",
            bbox={"facecolor": "white", "edgecolor": _MARK, "pad": 2},
        )  # fmt: skip
    axis.set_axis_off()
    return figure


def shift_figure(shift: ShiftMeasurement) -> Figure:
    """Both components of the measured displacement, window by window [mpx], and its direction."""
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    axes = figure.subplots(1, 2)
    limit = 1e3 * float(np.percentile(np.abs(shift.displacement_px), 98)) or 1e-3
    columns, rows = (np.unique(shift.centres_px[:, i]) for i in (0, 1))
    picture = np.full((len(rows), len(columns), 2), np.nan)
    at = np.searchsorted(rows, shift.centres_px[:, 1]), np.searchsorted(columns, shift.centres_px[:, 0])
    picture[at] = 1e3 * shift.displacement_px
    extent = (columns[0], columns[-1], rows[-1], rows[0])
    for axis, index, title in ((axes[0], 0, "to the right"), (axes[1], 1, "downwards")):
        drawn = axis.imshow(
            picture[..., index],
            cmap=DIVERGING,
            vmin=-limit,
            vmax=limit,
            extent=extent,
            interpolation="nearest",
        )
        axis.set_title(f"shift of the pattern, {title}")
        axis.set_xlabel("column [px]")
        axis.set_ylabel("row [px]")
        figure.colorbar(drawn, ax=axis, label="1/1000 px", shrink=0.85)
    return figure


def _three_planes(solution: Solution) -> tuple[Figure, list[Axes]]:
    """A figure with a place for each middle plane, a metre as long in all of them."""
    x_m, y_m, z_m = (float(np.ptp(axis)) for axis in (solution.x_m, solution.y_m, solution.z_m))
    widths = (x_m, y_m, x_m)
    tall_in = 10.2 * max(z_m, y_m) / sum(widths) + 0.9
    figure = Figure(figsize=(13, min(max(tall_in, 2.4), 6.0)), layout="constrained")
    return figure, list(figure.subplots(1, 3, gridspec_kw={"width_ratios": widths}))


def slices_figure(solution: Solution) -> Figure:
    """Temperature on three middle planes with lines of equal values, and arrows of velocity where it is known."""
    figure, axes = _three_planes(solution)
    # As a file keeps it: lines of equal values would follow the last digits.
    celsius = np.asarray(solution.temperature_k, np.float32) - np.float32(CELSIUS_K)
    low, high = np.nanpercentile(celsius[1:-1, 1:-1, 1:-1], [0.5, 99.5])
    levels = np.unique(MaxNLocator(8).tick_values(float(low), float(high)))
    drawn = [
        _slice(axis, solution, celsius, normal, AIR, float(low), float(high), levels=levels)
        for axis, normal in zip(axes, (1, 0, 2), strict=True)
    ]
    figure.colorbar(drawn[0], ax=axes, label="temperature [°C]", shrink=0.85, extend="both")
    return figure


def error_figure(solution: Solution, error_k: np.ndarray) -> Figure:
    """Temperature minus truth on the same planes, on the solution's vertices."""
    figure, axes = _three_planes(solution)
    limit = float(np.nanpercentile(np.abs(error_k[1:-1, 1:-1, 1:-1]), 98)) or 1e-6
    drawn = [
        _slice(axis, solution, error_k, normal, DIVERGING, -limit, limit, arrows=False)
        for axis, normal in zip(axes, (1, 0, 2), strict=True)
    ]
    figure.colorbar(drawn[0], ax=axes, label="found minus true [K]", shrink=0.85)
    return figure


def volume_figure(solution: Solution, values: np.ndarray, label: str, highest: float | None = None) -> Figure:
    """A volume from zero upwards on the three middle planes."""
    figure, axes = _three_planes(solution)
    limit = highest or float(np.nanpercentile(values[1:-1, 1:-1, 1:-1], 99)) or 1e-6
    drawn = [
        _slice(axis, solution, values, normal, SEQUENTIAL, 0.0, limit, arrows=False)
        for axis, normal in zip(axes, (1, 0, 2), strict=True)
    ]
    figure.colorbar(drawn[0], ax=axes, label=label, shrink=0.85)
    return figure


def plans_figure(plans: Sequence[FloorMap], zone_m: Sequence[Vector3] | None = None) -> Figure:
    """Maps seen from above, side by side, each with its own scale; dashed: the zone between two corners."""
    across_in = 13 / len(plans)
    tall = max(float(np.ptp(plan.y_m) / np.ptp(plan.x_m)) for plan in plans)
    figure = Figure(figsize=(13, min(0.8 * across_in * tall + 1.3, 4.8)), layout="constrained")
    axes = figure.subplots(1, len(plans), squeeze=False)[0]
    for axis, plan in zip(axes, plans, strict=True):
        low, high = plan.ends or (0.0, float(np.nanmax(plan.values)) or 1e-6)
        drawn = axis.pcolormesh(
            plan.x_m, plan.y_m, plan.values.T, cmap=plan.colours, vmin=low, vmax=high, shading="gouraud"
        )
        if zone_m is not None:
            (x0, y0, _), (x1, y1, _) = zone_m
            for style in ({"ec": "white", "lw": 2.2, "alpha": 0.7}, {"ec": "#222222", "lw": 1.1, "ls": "--"}):
                axis.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, **style))
        axis.set_aspect("equal")
        axis.set_title(plan.title)
        axis.set_xlabel("x [m]")
        axis.set_ylabel("y [m]")
        bar = figure.colorbar(
            drawn,
            ax=axis,
            label=plan.label,
            orientation="horizontal",
            shrink=0.9,
            extend=_beyond(plan, low, high),
        )
        if plan.marks:
            bar.set_ticks([value for value, _ in plan.marks], labels=[word for _, word in plan.marks])
    return figure


def _beyond(plan: FloorMap, low: float, high: float) -> str:
    """Which ends of a scale values lie beyond, as Matplotlib says it."""
    ends = float(np.nanmin(plan.values)) < low, float(np.nanmax(plan.values)) > high
    return {(True, True): "both", (True, False): "min", (False, True): "max"}.get(ends, "neither")


def _slice(
    axis,
    solution: Solution,
    values: np.ndarray,
    normal: int,
    cmap: str,
    low: float,
    high: float,
    arrows: bool = True,
    levels: Sequence[float] | np.ndarray = (),
):
    coordinates = (solution.x_m, solution.y_m, solution.z_m)
    across, up = [i for i in range(3) if i != normal]
    middle = len(coordinates[normal]) // 2
    drawn = axis.pcolormesh(
        coordinates[across],
        coordinates[up],
        np.take(values, middle, axis=normal).T,
        cmap=cmap,
        vmin=low,
        vmax=high,
        shading="gouraud",
    )
    if len(levels):
        lines = axis.contour(
            coordinates[across], coordinates[up], np.take(values, middle, axis=normal).T, levels=levels,
            colors="#333333", linewidths=0.5, alpha=0.7,
        )  # fmt: skip
        axis.clabel(lines, fontsize=7, fmt="%g")
    if arrows and solution.velocity_m_s is not None:
        _arrows(axis, np.take(solution.velocity_m_s, middle, axis=normal), coordinates, across, up)
    axis.set_aspect("equal")
    axis.set_title(f"{'xyz'[normal]} = {coordinates[normal][middle]:.2f} m")
    axis.set_xlabel(f"{'xyz'[across]} [m]")
    axis.set_ylabel(f"{'xyz'[up]} [m]")
    return drawn


def _arrows(axis, velocity: np.ndarray, coordinates, across: int, up: int) -> None:
    step_a, step_u = (max(1, len(coordinates[i]) // 18) for i in (across, up))
    part = velocity[::step_a, ::step_u]
    axis.quiver(
        coordinates[across][::step_a],
        coordinates[up][::step_u],
        part[..., across].T,
        part[..., up].T,
        color="#102030",
        width=0.003,
        alpha=0.9,
    )


def shift_field_figure(displacement_px: np.ndarray) -> Figure:
    """A dense displacement field: both components [px]."""
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.subplots(1, 2)
    limit = float(np.percentile(np.abs(displacement_px), 99)) or 1e-3
    for axis, index, title in ((axes[0], 0, "to the right"), (axes[1], 1, "downwards")):
        drawn = axis.imshow(displacement_px[..., index], cmap=DIVERGING, vmin=-limit, vmax=limit)
        axis.set_title(f"displacement, {title}")
        axis.set_xlabel("column [px]")
        axis.set_ylabel("row [px]")
    figure.colorbar(drawn, ax=axes, label="px", shrink=0.8)
    return figure
