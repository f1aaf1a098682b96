"""Where a thing would stand that hides a part of the wall: plain geometry of one view.

One view does not see depth. What stands on the floor tells it: the ray through its foot meets the floor where it
stands. Without its foot, the lowest ray that it hides says how far away it is at most. How deep the thing is cannot
be seen: a box as deep as the smaller of its width and height is taken.
"""

from dataclasses import dataclass, replace

from core.geometry import Box, Vector2, Vector3

# A box is never thinner than this, where the wall behind it leaves no room.
_THINNEST_M = 0.02


@dataclass(frozen=True)
class Silhouette:
    """What a thing hides of the wall, as the camera at `eye_m` sees it: from and to along x and z [m]."""

    eye_m: Vector3
    x_m: Vector2
    z_m: Vector2


def meets_floor_m(eye_m: Vector3, wall_point_m: Vector3, floor_m: float) -> float | None:
    """The y at which the ray from the eye to a point of the wall's plane meets the floor; None for one that rises."""
    fall_m = eye_m[2] - wall_point_m[2]
    if fall_m <= 0.0 or eye_m[2] <= floor_m:
        return None
    return eye_m[1] + (wall_point_m[1] - eye_m[1]) * (eye_m[2] - floor_m) / fall_m


def box_of(seen: Silhouette, room: Box, front_m: float | None, on_floor: bool) -> tuple[Vector3, Vector3]:
    """The lower and upper corner of the box with that silhouette.

    `front_m` is the y of its front face; without one its back touches the wall. `on_floor`: it stands there.
    """
    (_, eye_y, eye_z), (_, wall_y, _), floor = seen.eye_m, room.upper_m, room.lower_m[2]
    reach_m = wall_y - eye_y
    if on_floor:
        # The ray through its foot: at the wall, unless its front is nearer.
        share = 1.0 if front_m is None else (front_m - eye_y) / reach_m
        seen = replace(seen, z_m=(eye_z + (floor - eye_z) / share, seen.z_m[1]))
    if front_m is None:
        front_m = wall_y - _depth_m(seen, reach_m, None)
    front_m = min(max(front_m, room.lower_m[1]), wall_y - _THINNEST_M)
    deep_m = _depth_m(seen, reach_m, (front_m - eye_y) / reach_m)
    back_m = min(front_m + max(deep_m, _THINNEST_M), wall_y)
    shares = (front_m - eye_y) / reach_m, (back_m - eye_y) / reach_m
    x0, x1 = _between(seen.x_m, seen.eye_m[0], shares)
    z0, z1 = _between(seen.z_m, eye_z, shares)
    return _inside((x0, front_m, floor if on_floor else z0), room), _inside((x1, back_m, z1), room)


def _depth_m(seen: Silhouette, reach_m: float, share: float | None) -> float:
    """The smaller of the width and the height of a box as deep as that; `share`: where its front is on the way.

    Without `share` its back is on the wall. Seen from beside, a part of the silhouette is the box's side.
    """
    found = []
    for ends, eye in ((seen.x_m, seen.eye_m[0]), (seen.z_m, seen.eye_m[2])):
        low, high = (end - eye for end in ends)
        side = 1.0 + max(low, -high, 0.0) / reach_m
        long_m = high - low
        found.append(long_m / (side + long_m / reach_m) if share is None else long_m * share / side)
    return min(found)


def _between(wall_m: Vector2, eye_m: float, shares: Vector2) -> Vector2:
    """A box's extent along x or z from its silhouette's; `shares`: its front and back on the way to the wall.

    The outermost edge is on the front face, unless the box lies wholly beyond the eye's axis on the other side.
    """
    low, high = (end - eye_m for end in wall_m)
    front, back = shares
    return eye_m + low * (front if low < 0.0 else back), eye_m + high * (front if high > 0.0 else back)


def _inside(corner_m: Vector3, room: Box) -> Vector3:
    """The corner to a millimetre, in the room."""
    x, y, z = (
        min(max(round(value, 3), low), high)
        for value, low, high in zip(corner_m, room.lower_m, room.upper_m, strict=True)
    )
    return x, y, z
