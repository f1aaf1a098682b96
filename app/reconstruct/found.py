"""What stands before the wall and was not stated: covered windows that hang together, and the box that hides them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import count

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

from app.experiment.found import Depth, Found
from app.reconstruct.cover import covered_windows
from app.reconstruct.foot import foot_row
from app.reconstruct.placing import Silhouette, box_of, meets_floor_m
from app.reconstruct.unstated import told, with_found
from core.displacement import resolve_window_px, window_centres
from core.geometry import Vector3
from core.objects import RoomObject
from core.rays.visibility import hidden_by_objects, sees_wall, wall_points
from core.scene import Scene
from core.view_frame import facing, turn_of

# A thing is so many windows wide and tall: the middle one is then covered wholly, wherever its edges lie.
_LEAST_WINDOWS = 3

Picture = Float32[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class _Region:
    """Covered windows that hang together: their bounds in the picture (pixel edges), and how many they are."""

    left: float
    top: float
    right: float
    bottom: float
    windows: int

    @property
    def middle(self) -> tuple[float, float]:
        return 0.5 * (self.left + self.right), 0.5 * (self.top + self.bottom)


@dataclass(frozen=True)
class Standing:
    """What the references show beside the stated: covered windows of each view, things, and the scene with them.

    `scene` has the things whose place is seen; those of which only the direction is known are not in it.
    """

    scene: Scene
    covered: tuple[Bool[np.ndarray, " windows"], ...] = ()
    things: tuple[Found, ...] = ()


def what_stands(scene: Scene, references: Sequence[Picture]) -> Standing:
    """Look for things in the reference of each view. What one view shows the next ones know of."""
    standing = Standing(scene)
    for view, reference in enumerate(references):
        window_px = resolve_window_px(scene, scene.views[view])
        covered = covered_windows(standing.scene, view, reference, window_px)
        taken = [one.box.name for one in standing.things]
        things = found_things(standing.scene, view, reference, covered, window_px, taken)
        boxes = [one.box for one in things if one.solved]
        room = reduce(with_found, boxes, standing.scene)
        standing = Standing(room, (*standing.covered, covered), (*standing.things, *things))
    return standing


def found_things(
    scene: Scene,
    view: int,
    reference: Picture,
    covered: Bool[np.ndarray, " windows"],
    window_px: int,
    taken: Sequence[str] = (),
) -> tuple[Found, ...]:
    """The things that hide the covered windows of a view, from left to right; specks and slivers are none.

    Each has a name of its own, which is not among `taken` either. In a view of floor or ceiling nothing is placed.
    """
    turn = turn_of(scene, view)
    if turn.axes[2] != 2:
        return ()
    regions = _regions(covered.reshape([n // window_px for n in reference.shape]), window_px)
    if not regions:
        return ()
    centres = window_centres(reference.shape, window_px)
    on_wall = int(sees_wall(scene, view, centres, 0.5 * window_px).sum())
    wall = _Wall(*facing(scene, view), reference, window_px, on_wall)
    free = wall.free_columns(regions)
    names = _names({*(item.name for item in scene.objects), *taken})
    things, room = [], scene
    for region, name in zip(regions, names, strict=False):
        found, on_floor = _found(wall, region, free, name)
        found = _in_room(found, scene, view)
        things.append(told(room, found, on_floor))
        room = with_found(room, found.box) if things[-1].solved else room
    return tuple(things)


def _in_room(found: Found, scene: Scene, view: int) -> Found:
    """What was found in a view's own frame, along the room's axes."""
    turn = turn_of(scene, view)
    low, high = sorted(turn.signs[0] * x_m for x_m in found.x_m)
    box = turn.back().thing(found.box)
    return replace(found, view=view, x_m=(low, high), box=box, wall=scene.views[view].wall)


def _regions(covered: Bool[np.ndarray, "rows columns"], window_px: int) -> list[_Region]:
    thick = ndimage.binary_opening(covered, np.ones((_LEAST_WINDOWS, _LEAST_WINDOWS)))
    labels = np.zeros(covered.shape, np.int32)
    ndimage.label(thick, output=labels)
    regions = []
    for number, place in enumerate(ndimage.find_objects(labels), start=1):
        (top, bottom), (left, right) = ((s.start * window_px - 0.5, s.stop * window_px - 0.5) for s in place)
        regions.append(_Region(left, top, right, bottom, int((labels[place] == number).sum())))
    return sorted(regions, key=lambda one: one.left)


def _names(taken: set[str]) -> Iterator[str]:
    return (name for n in count(1) if (name := f"found {n}") not in taken)


@dataclass(frozen=True)
class _Wall:
    """The wall as a view sees it; `windows` of the picture are wholly on it."""

    scene: Scene
    view: int
    picture: Picture
    window_px: int
    windows: int

    @property
    def eye_m(self) -> Vector3:
        return self.scene.views[self.view].camera.position_m

    @property
    def floor_m(self) -> float:
        return self.scene.room.lower_m[2]

    def points_m(self, *pixels: tuple[float, float]) -> Float[np.ndarray, "points 3"]:
        """Where pixels (column, row) look on the wall's plane."""
        return wall_points(self.scene, self.view, np.array(pixels, float))

    def free_columns(self, regions: list[_Region]) -> Bool[np.ndarray, " cols"]:
        """Columns below the wall's lower edge in which nothing stands, stated or found."""
        height, width = self.picture.shape
        row = float(min(self.first_row_below(0.0, width - 1.0), height - 1))
        pixels = np.stack([np.arange(width, dtype=float), np.full(width, row)], axis=1)
        x_m = self.points_m(*pixels)[:, 0]
        free = (x_m > self.scene.room.lower_m[0]) & (x_m < self.scene.room.upper_m[0])
        free &= ~hidden_by_objects(self.scene, self.view, pixels, float(self.window_px))
        for one in regions:
            free &= np.abs(pixels[:, 0] - one.middle[0]) > 0.5 * (one.right - one.left) + self.window_px
        return free

    def first_row_below(self, *columns: float) -> int:
        """The first row in which all these columns see the floor before the wall; the picture's height if none."""
        rows = np.arange(len(self.picture), dtype=float)
        below = [self.points_m(*((column, row) for row in rows))[:, 2] < self.floor_m for column in columns]
        found = np.flatnonzero(np.all(below, axis=0))
        return int(found[0]) if len(found) else len(rows)


def _found(wall: _Wall, region: _Region, free: Bool[np.ndarray, " cols"], name: str) -> tuple[Found, bool]:
    """The thing of a region, and whether it stands on the floor."""
    (column, row), room = region.middle, wall.scene.room
    sides = wall.points_m(
        (region.left, row), (region.right, row), (column, region.bottom), (column, region.top)
    )
    x0, x1, z0, z1 = (float(point[axis]) for point, axis in zip(sides, (0, 0, 2, 2), strict=True))
    seen = Silhouette(wall.eye_m, (x0, x1), (z0, z1))
    on_floor = _goes_down(wall, region)
    front_m, depth = _front(wall, region, free) if on_floor else (None, "unknown")
    lower_m, upper_m = box_of(seen, room, front_m, on_floor)
    box = RoomObject(name=name, lower_m=lower_m, upper_m=upper_m)
    outline = (region.left, region.top, region.right, region.bottom)
    found = Found(wall.view, region.windows / wall.windows, seen.x_m, seen.z_m, outline, depth, box)
    return found, on_floor


def _goes_down(wall: _Wall, region: _Region) -> bool:
    """Whether it hides the wall down to the lowest window that is wholly on it: then it stands on the floor."""
    below = region.bottom + wall.window_px
    return below > len(wall.picture) or float(wall.points_m((region.middle[0], below))[0, 2]) < wall.floor_m


def _front(wall: _Wall, region: _Region, free: Bool[np.ndarray, " cols"]) -> tuple[float | None, Depth]:
    """Where the ray through the lowest row that shows it meets the floor [m], and what that says of its depth."""
    first = wall.first_row_below(region.left, region.right)
    inner = slice(round(region.left + 0.5) + wall.window_px, round(region.right + 0.5) - wall.window_px)
    # The row on the wall's edge shows both.
    last = foot_row(wall.picture, first + 1, inner, free)
    if last is None:
        return None, "unknown"
    foot_m = wall.points_m((region.middle[0], last + 0.5))[0]
    y_m = meets_floor_m(wall.eye_m, (float(foot_m[0]), float(foot_m[1]), float(foot_m[2])), wall.floor_m)
    if y_m is None:
        return None, "unknown"
    return y_m, "at most" if last == len(wall.picture) - 1 else "seen"
