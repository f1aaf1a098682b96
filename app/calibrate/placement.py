"""Where a camera and its wall are in the room, as its calibration takes it."""

from collections.abc import Sequence

from app.errors import BadInputError
from calibration.record import Placement
from core.geometry import face_of
from core.scene import Scene
from core.view_frame import turn_to


def placed(
    scene: Scene,
    camera: str,
    anchor_px: tuple[float, float] | None = None,
    across_m: Sequence[float] | None = None,
    wall_m: float | None = None,
    plumb_px: tuple[float, float, float, float] | None = None,
) -> Placement:
    """The placement of a view's camera in its own frame, from coordinates of the room.

    `across_m` are the two coordinates across the view, in the order x, y, z: of the wall point at `anchor_px`, or
    without one of the camera (by default as the scene states it). `wall_m` is the wall's coordinate on the third
    axis, by default the room's. Raises BadInputError for a name that no view has.
    """
    view = next((one for one in scene.views if one.name == camera), None)
    if view is None:
        known = ", ".join(repr(one.name) for one in scene.views)
        raise BadInputError(f"There is no view {camera!r}; the scene's views are {known}.")
    face = face_of(view.wall)
    corner_m = scene.room.upper_m if face.upper else scene.room.lower_m
    point = list(view.camera.position_m)
    if across_m is not None:
        first, second = (axis for axis in range(3) if axis != face.axis)
        point[first], point[second] = across_m
    point[face.axis] = corner_m[face.axis] if wall_m is None else wall_m
    x_m, y_m, z_m = turn_to(view.wall).point((point[0], point[1], point[2]))
    return Placement(anchor_px, x_m, z_m, y_m, plumb_px, view.wall)
