"""Objects on the grid: the cells that they fill, and the faces that they turn to the air.

A cell is solid if its centre lies in an object; an object thinner than a cell takes the cells about its middle. The
faces between air and solid are walls: no flow, the friction and heat of the wall functions (`core.room.k_epsilon`).
A room without objects has no `Solids` at all, and none of this is compiled.
"""

from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy import ndimage

from core.objects import RoomObject
from core.room.room_grid import AXES, Cells, RoomGrid, Velocity
from core.setting import SettingError

Faces = Float[Array, " faces"]


class SurfaceHeat(eqx.Module):
    """What each face of an object gives to the air: a stated flux [K m/s], and h (T_surface - T) with h [m/s]."""

    flux_k_m_s: Faces
    conductance_m_s: Faces
    excess_k: Faces


class Solids(eqx.Module):
    """Where no air is. `air` is 1 in cells of air; `open_faces[a]` is 1 on faces normal to a between two of them.

    `open_edges[a][b]`: 1 on the edges between neighbouring a-faces along b whose four cells are air (none, a = b).
    The objects' `faces` are listed axis by axis, `count` of each: the flat index of the cell of air `beside` and of
    the solid cell `behind`, the distance from the face to that air's centre, and the object.
    `nearest` is the flat index of the air cell nearest to each cell.
    """

    count: tuple[int, int, int] = eqx.field(static=True)
    air: Cells
    open_faces: Velocity
    open_edges: tuple[tuple[Array, ...], ...]
    beside: Int[Array, " faces"]
    behind: Int[Array, " faces"]
    centre_m: Faces
    area_m2: Float[np.ndarray, " faces"]
    owner: Int[np.ndarray, " faces"]
    nearest: Int[Array, "nx ny nz"]
    heat: SurfaceHeat

    def along(self, axis: int) -> slice:
        """The faces normal to `axis`, in the list of all."""
        first = sum(self.count[:axis])
        return slice(first, first + self.count[axis])

    def next_air(self, field: Cells) -> Faces:
        """The values of a field in the air beside every face."""
        return field.reshape(-1)[self.beside]

    def added(self, field: Cells, values: Faces, faces: slice = slice(None)) -> Cells:
        """`field` with values added in the air beside the faces."""
        return field.reshape(-1).at[self.beside[faces]].add(values).reshape(field.shape)

    def filled(self, field: Cells) -> Cells:
        """`field` with the nearest air's values in the solid cells."""
        return field.reshape(-1)[self.nearest]


def lay_objects(objects: tuple[RoomObject, ...], grid: RoomGrid, notes: list[str]) -> Solids | None:
    """The objects on `grid`, without heat; None where there are none. Adds a sentence to `notes` for thin ones.

    Raises:
        SettingError: an object has no cell of its own, or the objects shut off a part of the room.
    """
    if not objects:
        return None
    owner = np.full(grid.cells, -1)
    for number, item in enumerate(objects):
        owner[_cells_of(item, grid, notes)] = number
    for number, item in enumerate(objects):
        if not (owner == number).any():
            raise SettingError(
                f"The object {item.name!r} has no cell of its own on the grid of {grid.cells} cells: another one "
                "takes its place. Join the two, or use a finer grid."
            )
    solid = owner >= 0
    if pieces(~solid)[1] != 1:
        raise SettingError(
            "The objects shut off a part of the room, on the grid of "
            f"{' x '.join(map(str, grid.cells))} cells. Leave a gap of two cells, or fill that part with an object."
        )
    return _solids(solid, owner, grid)


def pieces(where: Bool[np.ndarray, "nx ny nz"]) -> tuple[Int[np.ndarray, "nx ny nz"], int]:
    """Cells that hang together by faces, numbered from 1, and how many such pieces there are."""
    return cast("tuple[np.ndarray, int]", ndimage.label(where))


def _cells_of(item: RoomObject, grid: RoomGrid, notes: list[str]) -> tuple[slice, ...]:
    taken = []
    for a in AXES:
        centres = grid.centres_m(a)
        inside = np.flatnonzero((centres > item.lower_m[a]) & (centres < item.upper_m[a]))
        if not len(inside):
            middle_m = 0.5 * (item.lower_m[a] + item.upper_m[a])
            inside = np.array([np.argmin(np.abs(centres - middle_m))])
        if item.size_m[a] < 0.5 * grid.spacing_m[a]:
            notes.append(
                f"The object {item.name!r} is {item.size_m[a]:.3g} m wide along {'xyz'[a]}, less than half of the "
                f"cells' {grid.spacing_m[a]:.3g} m: it is one cell thick in the model."
            )
        taken.append(slice(int(inside[0]), int(inside[-1]) + 1))
    return tuple(taken)


def _solids(
    solid: Bool[np.ndarray, "nx ny nz"], owner: Int[np.ndarray, "nx ny nz"], grid: RoomGrid
) -> Solids:
    index = np.arange(solid.size).reshape(solid.shape)
    beside, behind, centre_m, area_m2, count = [], [], [], [], []
    for a in AXES:
        low, high = (np.take(index, range(s, solid.shape[a] - 1 + s), axis=a).ravel() for s in (0, 1))
        at_low, at_high = solid.ravel()[low], solid.ravel()[high]
        found = at_low != at_high
        beside.append(np.where(at_low, high, low)[found])
        behind.append(np.where(at_low, low, high)[found])
        count.append(int(found.sum()))
        centre_m.append(np.full(count[a], 0.5 * grid.spacing_m[a]))
        area_m2.append(np.full(count[a], grid.face_area_m2(a)))
    places = cast(
        "np.ndarray",
        ndimage.distance_transform_edt(
            solid, sampling=grid.spacing_m, return_distances=False, return_indices=True
        ),
    )
    air = ~solid
    zero = jnp.zeros(sum(count), jnp.float32)
    u, v, w = (_f32(_between(air, a)) for a in AXES)
    at = np.concatenate(behind)
    return Solids(
        (count[0], count[1], count[2]),
        _f32(air),
        (u, v, w),
        tuple(tuple(jnp.zeros(0) if a == b else _f32(_edges(air, a, b)) for b in AXES) for a in AXES),
        jnp.asarray(np.concatenate(beside), jnp.int32),
        jnp.asarray(at, jnp.int32),
        _f32(np.concatenate(centre_m)),
        np.concatenate(area_m2),
        owner.ravel()[at],
        jnp.asarray(np.ravel_multi_index(tuple(places), solid.shape), jnp.int32),
        SurfaceHeat(zero, zero, zero),
    )


def _between(air: Bool[np.ndarray, "..."], axis: int) -> Bool[np.ndarray, "..."]:
    """Faces along `axis` with air on both sides; beyond the room's walls counts as the cell itself."""
    padded = np.pad(air, [(1, 1) if a == axis else (0, 0) for a in AXES], mode="edge")
    n = padded.shape[axis]
    return np.take(padded, range(1, n), axis=axis) & np.take(padded, range(n - 1), axis=axis)


def _edges(air: Bool[np.ndarray, "..."], a: int, b: int) -> Bool[np.ndarray, "..."]:
    """At the inner a-faces, between neighbours along b."""
    inner = np.take(_between(air, a), range(1, air.shape[a]), axis=a)
    return _between(inner, b)


def _f32(values: np.ndarray) -> Float[Array, "..."]:
    return jnp.asarray(values, jnp.float32)
