"""What a simulated camera sees beyond the patterned wall, and marks near it.

Beyond the wall is a still print in a frame, or the side walls, floor and ceiling of the room: behind the same air,
which moves them otherwise than a camera would.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float32
from scipy import ndimage

from core.fields import AbstractField
from core.geometry import WALLS, Box, Optics, crop
from core.plan.print_choice import suited_print
from core.rays.visibility import sees_wall, wall_points
from core.render import render_flow, render_reference
from core.scene import FixedTexture, Scene

Picture = Float32[np.ndarray, "rows cols"]
Strip = tuple[slice, slice]

# The print around a simulated room: as fine as the pattern, but another one.
FRAME_SEED = 1_000_003
# The boards of marks: each another print, coarser than the frame's, and reaching so far beyond the marks.
MARKS_SEED, _COARSER, _RIM_PX = 1_000_033, 4.0, 8
# Of side walls, floor and ceiling; seen aslant, so coarser.
_SIDES_SEED, _ASLANT, _EVERY_PX = 1_000_081, 3.0, 8
# The width of a print's faded edge.
_FADE_PX = 8.0


def in_frame(image: Picture, scene: Scene, view: int, focal_px: float) -> Picture:
    """The picture in a printed frame: what lies beyond the wall is still, and shows the camera's drift."""
    beyond, camera = image == 0, scene.views[view].camera
    frame = _wide(scene, view, focal_px, FRAME_SEED)
    framed = image.copy()
    for strip in _strips_around(~beyond):
        framed[strip] = np.where(beyond[strip], _strip(frame, view, camera, strip), image[strip])
    return framed


def in_room(image: Picture, scene: Scene, view: int, focal_px: float, field: AbstractField | None) -> Picture:
    """The picture with the textured walls beside the one that the view looks at, through the same air."""
    shown, beyond = image.copy(), image == 0
    eye = scene.views[view]
    print_ = _print(scene, view, focal_px, 0)
    for strip in _strips_around(~beyond):
        for number, wall in enumerate(one for one in WALLS if one[0] != "y"):
            pattern = replace(print_.pattern, seed=_SIDES_SEED + number)
            light = replace(print_, pattern=pattern, pixel_m=_ASLANT * print_.pixel_m)
            side = replace(eye, wall=wall, light=light, camera=crop(eye.camera, *strip), marks=())
            part = replace(scene, views=(side,), objects=())
            if _is_seen(part):
                drawn = render_reference(part) if field is None else render_flow(part, field)
                shown[strip] = np.where(beyond[strip] & (shown[strip] == 0), drawn, shown[strip])
    return shown


def _is_seen(scene: Scene) -> bool:
    """Whether any pixel sees the wall of the only view."""
    camera = scene.views[0].camera
    pixels = np.stack(
        np.meshgrid(np.arange(0.0, camera.width_px, _EVERY_PX), np.arange(0.0, camera.height_px, _EVERY_PX)),
        axis=-1,
    ).reshape(-1, 2)
    return bool(sees_wall(scene, 0, pixels, margin_px=-float(_EVERY_PX)).any())


def with_marks(image: Picture, scene: Scene, view: int, focal_px: float, blur_px: float) -> Picture:
    """The picture with a still board wherever the view has marks, some pixels larger than they are.

    A board near the camera is out of focus, so its print is coarse for a lens of this focal length. No air of the
    room is before it.
    """
    marked, camera = image.copy(), scene.views[view].camera
    for number, marks in enumerate(scene.views[view].marks):
        rows, cols = (
            slice(max(round(low) - _RIM_PX, 0), min(round(high) + _RIM_PX + 1, length))
            for low, high, length in zip(marks.lower_px[::-1], marks.upper_px[::-1], image.shape, strict=True)
        )
        if rows.stop > rows.start and cols.stop > cols.start:
            board = _wide(scene, view, focal_px, MARKS_SEED + number, _COARSER)
            drawn = _strip(board, view, camera, (rows, cols))
            marked[rows, cols] = ndimage.gaussian_filter(drawn, blur_px, mode="nearest")
    return marked


def _wide(scene: Scene, view: int, focal_px: float, seed: int, coarser: float = 1.0) -> Scene:
    """A wall that reaches beyond the room's on all sides, with a print that suits a lens of this focal length."""
    room, reach_m = scene.room, 0.1 * max(scene.room.size_m)
    (x0, y0, z0), (x1, y1, z1) = room.lower_m, room.upper_m
    wide = Box(lower_m=(x0 - reach_m, y0, z0 - reach_m), upper_m=(x1 + reach_m, y1, z1 + reach_m))
    print_ = _print(scene, view, focal_px, seed)
    return replace(scene, room=wide, light=replace(print_, pixel_m=coarser * print_.pixel_m), objects=())


def _print(scene: Scene, view: int, focal_px: float, seed: int) -> FixedTexture:
    """A print on the back wall that suits the view's camera with a lens of this focal length."""
    camera = replace(scene.views[view].camera, focal_px=(focal_px, focal_px))
    return suited_print(camera, scene.room.upper_m[1] - camera.position_m[1], seed)


def _strip(scene: Scene, view: int, camera: Optics, strip: Strip) -> Picture:
    """Rows and columns of what this camera sees through still air; the print fades out at its edges."""
    part = replace(scene.views[view], camera=crop(camera, *strip), marks=())
    scene = replace(scene, views=tuple(part if i == view else v for i, v in enumerate(scene.views)))
    return render_reference(scene, view) * _fade(scene, view)


def _fade(scene: Scene, view: int) -> Picture:
    """What the print's brightness is multiplied by in each pixel: 1, and down to 0 at the edges of its wall.

    A cut edge is sharper than pixels can follow: a motion of 0.1 px is read up to 0.03 px wrong beside it.
    """
    camera, room = scene.views[view].camera, scene.room
    columns, rows = np.arange(float(camera.width_px)), np.arange(float(camera.height_px))
    at_m = wall_points(scene, view, np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    inside_m = np.minimum(at_m - room.lower_m, np.asarray(room.upper_m) - at_m)[:, ::2].min(axis=1)
    range_m = np.linalg.norm(at_m - camera.position_m, axis=1)
    share = np.clip(np.nan_to_num(inside_m * min(camera.focal_px) / range_m / _FADE_PX), 0.0, 1.0)
    return (share**2 * (3.0 - 2.0 * share)).reshape(len(rows), len(columns)).astype(np.float32)


def _strips_around(inside: np.ndarray) -> list[Strip]:
    """The four strips (rows, columns) around the bounding box of what is inside."""
    rows, cols = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return [(slice(0, inside.shape[0]), slice(0, inside.shape[1]))]
    # One pixel more, for a box that is not quite upright in the picture.
    top, bottom = int(rows[0]) + 2, int(rows[-1]) - 1
    left, right = int(cols[0]) + 2, int(cols[-1]) - 1
    strips = [
        (slice(0, top), slice(0, inside.shape[1])),
        (slice(bottom, inside.shape[0]), slice(0, inside.shape[1])),
        (slice(top, bottom), slice(0, left)),
        (slice(top, bottom), slice(right, inside.shape[1])),
    ]
    return [(r, c) for r, c in strips if r.stop > r.start and c.stop > c.start]
