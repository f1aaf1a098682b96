"""A view's own frame: the room turned so that the wall that a view looks at is y_max.

Rays, rendering and visibility know one back wall, y = upper_m[1]. A view of another wall is the same problem in a
room that is turned by quarter turns about the origin: coordinates change places and signs, and no digit is lost.
Pictures, windows and shifts are the same in both frames.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.fields import AbstractField, Components, GridField
from core.geometry import WALLS, Box, Optics, Vector3, WallName, face_of, rotation_vector
from core.objects import RoomObject
from core.scene import Light, ProjectedPattern, Scene, View

# Rows: the frame's axes in the room, as signed axis numbers from 1. Each is a rotation.
_ROWS: dict[WallName, tuple[int, int, int]] = {
    "x_min": (2, -1, 3),
    "x_max": (-2, 1, 3),
    "y_min": (-1, -2, 3),
    "y_max": (1, 2, 3),
    "z_min": (1, -3, 2),
    "z_max": (1, 3, -2),
}


@dataclass(frozen=True)
class Turn:
    """From the room's axes to a view's: axis i of the frame is the room's axis `axes[i]`, times `signs[i]`."""

    axes: tuple[int, int, int]
    signs: tuple[float, float, float]

    @property
    def is_none(self) -> bool:
        """Whether the frame is the room's own."""
        return self.axes == (0, 1, 2) and min(self.signs) > 0

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """frame = matrix @ room."""
        matrix = np.zeros((3, 3))
        matrix[range(3), self.axes] = self.signs
        return matrix

    def point(self, room_m: Vector3) -> Vector3:
        """A point of the room in the frame."""
        x, y, z = (sign * float(room_m[axis]) for axis, sign in zip(self.axes, self.signs, strict=True))
        return x, y, z

    def shape(self, shape: tuple[int, int, int]) -> tuple[int, int, int]:
        """Numbers along the room's axes, along the frame's."""
        nx, ny, nz = (shape[axis] for axis in self.axes)
        return nx, ny, nz

    def volume(self, values: Float[Array, "nx ny nz"]) -> Float[Array, "fx fy fz"]:
        """Values on vertices of the room, index order [ix, iy, iz], on those of the frame."""
        if self.is_none:
            return values
        backwards = tuple(n for n, sign in enumerate(self.signs) if sign < 0)
        return jnp.flip(jnp.transpose(values, self.axes), backwards)

    def box(self, box: Box) -> Box:
        """The room."""
        lower_m, upper_m = self._corners(box.lower_m, box.upper_m)
        return Box(lower_m=lower_m, upper_m=upper_m)

    def thing(self, item: RoomObject) -> RoomObject:
        """An object."""
        lower_m, upper_m = self._corners(item.lower_m, item.upper_m)
        return replace(item, lower_m=lower_m, upper_m=upper_m)

    def optics(self, optics: Optics) -> Optics:
        """A camera or projector."""
        turned = rotation_vector(optics.rotation @ self.matrix.T)
        return replace(optics, position_m=self.point(optics.position_m), rotation_rad=turned)

    def back(self) -> "Turn":
        """From the frame's axes to the room's."""
        axes = [self.axes.index(n) for n in range(3)]
        return Turn((axes[0], axes[1], axes[2]), _three([self.signs[n] for n in axes]))

    def _corners(self, lower_m: Vector3, upper_m: Vector3) -> tuple[Vector3, Vector3]:
        ends = self.point(lower_m), self.point(upper_m)
        return _three(np.minimum(*ends).tolist()), _three(np.maximum(*ends).tolist())


class TurnedField(AbstractField):
    """A field of the room, asked for at places of the frame."""

    field: AbstractField
    turn: Turn

    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """Value, and the gradient along the frame's axes."""
        back, turn = self.turn.back(), self.turn
        x, y, z = (sign * place_m[axis] for axis, sign in zip(back.axes, back.signs, strict=True))
        value, slopes = self.field.at((x, y, z))
        fx, fy, fz = (sign * slopes[axis] for axis, sign in zip(turn.axes, turn.signs, strict=True))
        return value, (fx, fy, fz)


def turn_to(wall: WallName) -> Turn:
    """The quarter turns that make a wall y_max."""
    rows = _ROWS[wall]
    return Turn(
        (abs(rows[0]) - 1, abs(rows[1]) - 1, abs(rows[2]) - 1), _three([float(np.sign(row)) for row in rows])
    )


def turn_of(scene: Scene, view: int) -> Turn:
    """The quarter turns from the room to a view's own frame."""
    return turn_to(scene.views[view].wall)


def facing(scene: Scene, view: int) -> tuple[Scene, int]:
    """The scene in a view's own frame and the view's number there, which looks at y_max by the scene's light.

    A view of y_max that has no light of its own is in its frame already. What is known at the boundary stays behind:
    rays do not ask for it.
    """
    eye = scene.views[view]
    if eye.wall == "y_max" and eye.light is None:
        return scene, view
    return _turned(scene, view), 0


@lru_cache(maxsize=32)
def _turned(scene: Scene, view: int) -> Scene:
    turn, eye = turn_of(scene, view), scene.views[view]
    light: Light = scene.light if eye.light is None else eye.light
    if isinstance(light, ProjectedPattern):
        light = replace(light, projector=turn.optics(light.projector))
    own = replace(eye, wall="y_max", light=None, camera_of=None, camera=turn.optics(eye.camera))
    objects = tuple(turn.thing(item) for item in scene.objects)
    return replace(scene, room=turn.box(scene.room), views=(own,), light=light, boundary=(), objects=objects)


def each_alone(scene: Scene) -> Scene:
    """The scene with a camera for every view: where one light is tried in the place of another."""
    return replace(scene, views=tuple(replace(view, camera_of=None) for view in scene.views))


def field_facing(field: AbstractField, turn: Turn) -> AbstractField:
    """A field of the room in a view's own frame."""
    if turn.is_none:
        return field
    if isinstance(field, GridField):
        box = turn.box(Box(lower_m=field.lower_m, upper_m=field.upper_m))
        return GridField(box.lower_m, box.upper_m, turn.volume(jnp.asarray(field.values)))
    return TurnedField(field, turn)


def looked_along(scene: Scene) -> tuple[int, ...]:
    """The axes that views look along, each once, in the order x, y, z."""
    return tuple(sorted({face_of(view.wall).axis for view in scene.views}))


def passed_walls(view: View, room: Box) -> frozenset[WallName]:
    """The walls whose layers of air bend a view's rays: the one that it looks at, and the one that it looks through.

    A camera that stands in the room looks through none.
    """
    through = WALLS[face_of(view.wall).number ^ 1]
    front = face_of(through)
    inside = (view.camera.position_m[front.axis] - front.place_m(room)) * front.inward >= 0.0
    return frozenset({view.wall} if inside else {view.wall, through})


def told_on_floor(scene: Scene) -> tuple[int, ...]:
    """The floor's axes, 0 for x and 1 for y, that a view does not look along: it tells where along it air rises."""
    along = set(looked_along(scene))
    return tuple(axis for axis in (0, 1) if along - {axis})


def _three(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z
