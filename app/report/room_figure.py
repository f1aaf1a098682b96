"""A picture of the room as somebody would see it: box, openings, the air on a plane, and lines that it flows along.

Orthographic: a point goes to the paper by one matrix, so Matplotlib's plain artists draw it, the far ones first.
"""

import numpy as np
from jaxtyping import Float
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.ndimage import map_coordinates

from app.report.figures import AIR, SEQUENTIAL
from core.comfort import CELSIUS_K
from core.geometry import Box, Vector3, face_of
from core.result import Solution
from core.scene import OnPatch, Patch, Scene

# From the front, a little from the left and from above.
_AZIMUTH_RAD, _ELEVATION_RAD = np.radians(-68.0), np.radians(20.0)
# Starts of lines along each axis, points of a line, and how long a line is over the room's diagonal.
_STARTS, _POINTS, _LENGTH = (4, 4, 4), 160, 0.9
_COLOURS = {"inlet": "#1f77d0", "outlet": "#d06a1f", "heater": "#c62828"}
_OTHER = "#777777"
_WORDS = {"inlet": "supply", "outlet": "outlet", "heater": "heater"}

Points = Float[np.ndarray, "... 3"]


def room_figure(solution: Solution, scene: Scene, width_in: float = 10.0) -> Figure:
    """The room with its temperature on the middle plane and, where velocity is known, 64 lines of the flow."""
    figure = Figure(figsize=(width_in, 0.6 * width_in), layout="constrained")
    axis = figure.subplots()
    _box(axis, scene.room, far=True)
    _openings(axis, scene)
    solution = solution.filled()
    lines = [] if solution.velocity_m_s is None else flow_lines(solution)
    y_m = solution.y_m
    middle = 0.5 * float(y_m[0] + y_m[-1])
    fastest = max((float(speed.max()) for _, speed in lines), default=1.0)
    behind, before = (
        [one for one in lines if bool(one[0][:, 1].mean() > middle) is far] for far in (True, False)
    )
    drawn = _draw_lines(axis, behind, fastest, 2)
    warm = _plane(axis, solution, 3)
    drawn = _draw_lines(axis, before, fastest, 4) or drawn
    _box(axis, scene.room, far=False)
    figure.colorbar(warm, ax=axis, label="temperature on the plane [°C]", shrink=0.7, extend="both", pad=0.01)
    if drawn is not None:
        figure.colorbar(drawn, ax=axis, label="speed along the lines [m/s]", shrink=0.7, pad=0.01)
    _frame(axis, scene.room)
    return figure


def _frame(axis, room: Box) -> None:
    """The whole box, a metre as long upwards as to the right, without axes."""
    corners = np.stack(np.meshgrid(*zip(room.lower_m, room.upper_m, strict=True), indexing="ij"), axis=-1)
    seen = paper(corners.reshape(-1, 3))
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = 0.06 * float(np.max(high - low))
    axis.set_xlim(low[0] - margin, high[0] + margin)
    axis.set_ylim(low[1] - margin, high[1] + margin)
    axis.set_aspect("equal")
    axis.set_axis_off()


def paper(points_m: Points) -> Float[np.ndarray, "... 2"]:
    """Where points of the room lie on the paper: to the right, and upwards."""
    a, e = _AZIMUTH_RAD, _ELEVATION_RAD
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])
    return np.asarray(points_m, np.float64) @ np.stack([right, up], axis=1)


def flow_lines(
    solution: Solution,
) -> list[tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]]:
    """Lines along the mean flow from an even lattice of starts, with the speed at their points.

    Steps of equal length by the midpoint rule, all lines at once: for a picture, `core.streamlines` is too exact.
    """
    axes = [np.asarray(axis, np.float64) for axis in (solution.x_m, solution.y_m, solution.z_m)]
    low, high = np.array([axis[0] for axis in axes]), np.array([axis[-1] for axis in axes])
    cells = np.array([len(axis) - 1 for axis in axes])
    parts = np.moveaxis(np.asarray(solution.velocity_m_s, np.float64), -1, 0)

    def velocity(at_m: np.ndarray) -> np.ndarray:
        index = ((at_m - low) / (high - low) * cells).T
        return np.stack([map_coordinates(part, index, order=1, mode="nearest") for part in parts], axis=-1)

    shares = [(np.arange(n) + 0.5) / n for n in _STARTS]
    here = low + np.stack(np.meshgrid(*shares, indexing="ij"), axis=-1).reshape(-1, 3) * (high - low)
    step_m = _LENGTH * float(np.linalg.norm(high - low)) / _POINTS
    points, speeds = [here], [np.linalg.norm(velocity(here), axis=-1)]
    for _ in range(_POINTS):
        first = velocity(here)
        half = here + 0.5 * step_m * first / np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-9)
        there = velocity(half)
        speed = np.linalg.norm(there, axis=-1)
        here = here + step_m * there / np.maximum(speed, 1e-9)[:, None]
        points.append(here)
        speeds.append(speed)
    track, speed = np.stack(points, axis=1), np.stack(speeds, axis=1)
    inside = np.all((track >= low) & (track <= high), axis=-1) & (speed > 1e-3 * speed.max())
    ends = np.where(inside.all(axis=1), inside.shape[1], np.argmin(inside, axis=1))
    return [(track[n, :end], speed[n, :end]) for n, end in enumerate(ends) if end > 3]


def _draw_lines(axis, lines, fastest: float, order: int):
    if not lines:
        return None
    pieces = [np.stack([paper(p)[:-1], paper(p)[1:]], axis=1) for p, _ in lines]
    drawn = LineCollection(
        np.concatenate(pieces).tolist(), cmap=SEQUENTIAL, linewidths=1.3, zorder=order, capstyle="round"
    )
    drawn.set_array(np.concatenate([speed[:-1] for _, speed in lines]))
    drawn.set_clim(0.0, fastest)
    axis.add_collection(drawn)
    for points, _ in lines:
        tail, head = paper(points[len(points) // 2 : len(points) // 2 + 2])
        axis.annotate(
            "", head, tail, arrowprops={"arrowstyle": "->", "lw": 0.9, "color": "#333333"}, zorder=order
        )
    return drawn


def _plane(axis, solution: Solution, order: int):
    middle = solution.temperature_k.shape[1] // 2
    celsius = np.asarray(solution.temperature_k[:, middle], np.float32) - np.float32(CELSIUS_K)
    x, z = np.meshgrid(solution.x_m, solution.z_m, indexing="ij")
    place = paper(np.stack([x, np.full_like(x, solution.y_m[middle]), z], axis=-1))
    # The walls' own temperatures are not the air's.
    low, high = np.nanpercentile(celsius[1:-1, 1:-1], [1, 99])
    return axis.pcolormesh(
        place[..., 0], place[..., 1], celsius, cmap=AIR, vmin=low, vmax=high, shading="gouraud",
        zorder=order,
    )  # fmt: skip


def _openings(axis, scene: Scene) -> None:
    middle_x = float(paper(np.array(scene.room.centre_m))[0])
    for part in scene.boundary:
        if isinstance(part, OnPatch):
            corners = paper(np.array(corners_of(part.patch, scene.room)))
            colour, word = _COLOURS.get(part.kind, _OTHER), _WORDS.get(part.kind, part.kind)
            axis.add_patch(
                Polygon(corners, closed=True, facecolor=colour, alpha=0.55, edgecolor=colour, zorder=1.5)
            )
            _name(axis, corners.mean(axis=0), word, middle_x)


def _name(axis, at: np.ndarray, word: str, middle_x: float) -> None:
    """A word beside what it names, on the side where the room ends."""
    side = -1 if at[0] < middle_x else 1
    axis.annotate(
        word, at, (side * 34, 12), textcoords="offset points", fontsize=9, zorder=6, va="center",
        ha="right" if side < 0 else "left",
        bbox={"facecolor": "white", "edgecolor": "#99a1ab", "boxstyle": "round,pad=0.25", "lw": 0.6},
        arrowprops={"arrowstyle": "-", "color": "#4a525c", "lw": 0.8},
    )  # fmt: skip


def corners_of(patch: Patch, room: Box) -> list[Vector3]:
    """The four corners of a patch, in order round it."""
    face = face_of(patch.wall)
    wall_m = (room.lower_m if face.inward > 0 else room.upper_m)[face.axis]
    (a0, b0), (a1, b1) = patch.lower_m, patch.upper_m
    corners: list[Vector3] = []
    for a, b in ((a0, b0), (a1, b0), (a1, b1), (a0, b1)):
        at = [wall_m, wall_m, wall_m]
        at[face.along[0]], at[face.along[1]] = a, b
        corners.append((at[0], at[1], at[2]))
    return corners


def _box(axis, room: Box, *, far: bool) -> None:
    """The edges that meet in the far lower corner, behind everything; or the others, before it."""
    low, high = np.array(room.lower_m), np.array(room.upper_m)
    hidden = np.array([high[0] if _AZIMUTH_RAD > 0 else low[0], high[1], low[2]])
    for a in range(3):
        b, c = (other for other in range(3) if other != a)
        for end_b in (low[b], high[b]):
            for end_c in (low[c], high[c]):
                ends = np.zeros((2, 3))
                ends[:, a], ends[:, b], ends[:, c] = (low[a], high[a]), end_b, end_c
                if bool(end_b == hidden[b] and end_c == hidden[c]) is far:
                    line = paper(ends)
                    style = {"color": "#99a1ab", "lw": 0.8} if far else {"color": "#4a525c", "lw": 1.2}
                    axis.plot(line[:, 0], line[:, 1], zorder=1 if far else 5, **style)
                    if _is_labelled(a, end_b, end_c, low, high):
                        _length(axis, line.mean(axis=0), "xyz"[a], float(high[a] - low[a]))


def _is_labelled(a: int, end_b: float, end_c: float, low: np.ndarray, high: np.ndarray) -> bool:
    """One edge of each direction: the lower front one along x, the right one along y, the far right one along z."""
    b, c = (other for other in range(3) if other != a)
    wanted = {0: (low[1], low[2]), 1: (high[0], low[2]), 2: (high[0], high[1])}[a]
    return (end_b, end_c) == wanted and (b, c) != (a, a)


def _length(axis, at: np.ndarray, name: str, length_m: float) -> None:
    offset = {"x": (0, -11), "y": (16, -6), "z": (24, 0)}[name]
    axis.annotate(
        f"{name}: {length_m:.3g} m", at, offset, textcoords="offset points", ha="center", va="center", fontsize=9,
        color="#4a525c",
    )  # fmt: skip
