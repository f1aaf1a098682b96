"""How far T, its level, and what leaves by outlets may be off; and the correction of T that follows."""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import ArrayLike, Float

from core.data_error import WALL_MARGIN
from core.estimate.discrepancy import Correction, temperature_correction
from core.estimate.explained import explained
from core.estimate.forward_runs import Derivatives
from core.estimate.model_error import EACH
from core.estimate.observation import Observations
from core.geometry import WALLS, Box, Face, face_of
from core.known import stated_walls
from core.room.boundary_conditions import RoomLayout
from core.room.openings import Opening
from core.room.room_grid import AXES
from core.room.vertices import RoomFields, cell_matrix
from core.scene import Patch

# Least departure from the profile: air of one temperature has none, but its correction needs a prior.
_LEAST_DEPARTURE_K = 1e-3


def last_correction(
    data: Observations, derivatives: Derivatives, fields: RoomFields, outlet_std_k: float
) -> Correction:
    """The correction of T for these fields (`core.estimate.discrepancy`).

    T is expected to be wrong by the share of the room's own signal that the images leave.
    """
    own_k = max(departure(fields.excess_k), _LEAST_DEPARTURE_K)
    level_k = max(own_k, level_std_k(derivatives))
    residual = data.values()[0] - data.predicted(fields)
    wrong = explained(data, fields).left_over_own
    return temperature_correction(data, fields.excess_k, residual, own_k, level_k, wrong, outlet_std_k)


def outlets_apart_k(
    data: Observations, room: RoomFields, pairs: Iterable[tuple[RoomFields, RoomFields]]
) -> float:
    """How far what leaves may be from the air at the outlets' height, one standard deviation; 0 without outlets.

    An outlet may draw from a jet or a plume beside it: from any place along its wall at its heights, as `room` has
    them, and by as much as models differ in what leaves, which is what each pair of rooms differs by.
    """
    if not data.outlets:
        return 0.0
    along = np.mean([_along_wall_k2(data.scene.room, outlet.patch, room) for _, outlet, _ in data.outlets])
    apart = [_from_height_k(data, one) - _from_height_k(data, other) for one, other in pairs]
    return float(np.sqrt(along + sum(np.mean(np.square(difference)) for difference in apart)))


def _along_wall_k2(box: Box, patch: Patch, room: RoomFields) -> float:
    """Variance along the patch's wall of the air beside it; what leaves is a mean over the patch's heights."""
    face = face_of(patch.wall)
    beside = np.take(room.excess_k, face.before, axis=face.axis)[1:-1]
    if face.axis == 2:
        return float(beside[:, 1:-1].var())
    heights_m = np.linspace(box.lower_m[2], box.upper_m[2], beside.shape[1])
    nearest = np.abs(heights_m - 0.5 * (patch.lower_m[1] + patch.upper_m[1]))
    within = nearest <= max(0.5 * (patch.upper_m[1] - patch.lower_m[1]), nearest.min())
    return float(beside[:, within].mean(1).var())


def _from_height_k(data: Observations, room: RoomFields) -> Float[np.ndarray, " outlets"]:
    """What leaves by each measured outlet, minus the mean at its height."""
    layers_k = layer_means(room.excess_k)
    places = [n for n, *_ in data.outlets]
    return room.outflow_excess_k[places] - _at_outlets(data, layers_k)


def _at_outlets(data: Observations, layers_k: Float[np.ndarray, " vz"]) -> Float[np.ndarray, " outlets"]:
    """A profile at the heights of the measured outlets."""
    box = data.scene.room
    heights_m = np.linspace(box.lower_m[2], box.upper_m[2], len(layers_k))
    found = []
    for _, outlet, _ in data.outlets:
        patch, face = outlet.patch, face_of(outlet.patch.wall)
        middle_m = 0.5 * (patch.lower_m[1] + patch.upper_m[1])
        found.append(np.interp(face.place_m(box) if face.axis == 2 else middle_m, heights_m, layers_k))
    return np.array(found, float)


def layers_k(apart_k: Sequence[Float[np.ndarray, "vx vy vz"]]) -> Float[np.ndarray, "2 vx vy vz"]:
    """How wrong T may be beside the floor and beside the ceiling, one sigma of an error each.

    Windows there are left out (`WALL_MARGIN`), so no picture tells how T changes from the layer's edge to the wall.
    It may be wrong as models differ in that, over sqrt(2): `apart_k` is what each pair of them differs in. A layer is
    much the same all along its wall, so each is one error.
    """
    apart = np.stack(apart_k)
    edge = int(np.ceil(WALL_MARGIN * (apart.shape[3] - 1)))
    found = []
    for turned in (slice(None), slice(None, None, -1)):
        change = apart[..., turned] - apart[..., turned][..., [edge]]
        change[..., edge:] = 0.0
        square = EACH * np.sum(np.square(change[:, 1:-1, 1:-1]).mean((1, 2)), axis=0)
        found.append(np.broadcast_to(np.sqrt(square)[turned], apart.shape[1:]))
    return np.stack(found)


def layer_means(field: Float[np.ndarray, "vx vy vz"]) -> Float[np.ndarray, " vz"]:
    """Mean of a field at each height, without the side walls."""
    return field[1:-1, 1:-1].mean((0, 1))


def free_vertices(layout: RoomLayout, shape: tuple[int, int, int]) -> Float[np.ndarray, "vx vy vz"]:
    """1 at each vertex, but 0 on walls and heaters that show a temperature of their own."""
    free = np.ones(shape)
    for wall in np.flatnonzero(layout.own):
        free[_plane(face_of(WALLS[wall]))] = 0.0
    for heater, shown in zip(layout.heaters, layout.shown, strict=True):
        covered, plane = _covered(layout, heater, shape), _plane(face_of(WALLS[heater.wall]))
        # A suspected heater shows the air before it.
        free[plane] = free[plane] * (1.0 - covered) if shown else np.minimum(free[plane] + covered, 1.0)
    return free


def surfaces_std_k(
    data: Observations,
    layout: RoomLayout,
    wall_excess_k: Float[ArrayLike, "6"],
    excess_k: Float[np.ndarray, "vx vy vz"],
) -> Float[np.ndarray, "vx vy vz"]:
    """How far the surface of each wall may be from what its vertices show, one standard deviation; 0 elsewhere.

    A wall of stated temperature shows it, and may be off by its stated deviation. One of unknown temperature shows
    the air beside it, as an adiabatic wall would. It may be as far from that as the fit has it: its heat is fitted,
    and what its surface has depends on how heat passes the layer on it, which no picture sees.
    """
    std_k = np.zeros(excess_k.shape)
    for index, (name, wall) in enumerate(stated_walls(data.scene).items()):
        plane = _plane(face_of(name))
        if wall is not None and wall.temperature_k is not None:
            apart_k = np.full_like(excess_k[plane], wall.temperature_std_k)
        elif layout.heated[index] and not layout.own[index]:
            apart_k = np.abs(float(np.asarray(wall_excess_k)[index]) - excess_k[plane])
        else:
            continue
        for part in (*layout.inlets, *layout.outlets, *layout.heaters):
            if part.wall == index:
                apart_k = apart_k * (1.0 - _covered(layout, part, excess_k.shape))
        # An edge belongs to two walls.
        std_k[plane] = np.maximum(std_k[plane], apart_k)
    return std_k


def _covered(layout: RoomLayout, part: Opening, shape: tuple[int, ...]) -> Float[np.ndarray, "first second"]:
    """Share of each vertex of its wall that an opening or a heater covers."""
    first, second = (cell_matrix(layout.grid, a, shape[a]) for a in AXES if a != part.axis)
    return first @ np.pad(part.fraction, 1) @ second.T


def _plane(face: Face) -> tuple[slice | int, ...]:
    return tuple(face.end if a == face.axis else slice(None) for a in AXES)


def level_std_k(derivatives: Derivatives) -> float:
    """Prior deviation of the level: the parameters' prior deviations, through the derivatives of mean T."""
    return float(np.linalg.norm(derivatives.per_deviation(lambda run: run.excess_k.mean())))


def departure(field: Float[np.ndarray, "vx vy vz"]) -> float:
    """Rms departure of a field from its mean at each height, without the walls."""
    field = field[1:-1, 1:-1, 1:-1]
    return float(np.sqrt(np.mean((field - field.mean((0, 1))) ** 2)))
