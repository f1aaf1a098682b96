"""The room as a staggered grid of cells: pressure and temperature in the cells, velocity on their faces.

Harlow and Welch (1965). `velocity[a]` holds the component along axis a on the faces normal to a, so it
is one longer than the cells along a; its first and last planes are the walls.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from core.geometry import Box

AXES = (0, 1, 2)

Cells = Float[Array, "nx ny nz"]
Velocity = tuple[Float[Array, "nx1 ny nz"], Float[Array, "nx ny1 nz"], Float[Array, "nx ny nz1"]]


class RoomGrid(eqx.Module):
    """Uniform cells filling a box."""

    cells: tuple[int, int, int] = eqx.field(static=True)
    lower_m: tuple[float, float, float] = eqx.field(static=True)
    spacing_m: tuple[float, float, float] = eqx.field(static=True)

    @property
    def volume_m3(self) -> float:
        """Volume of one cell."""
        return float(np.prod(self.spacing_m))

    def face_area_m2(self, axis: int) -> float:
        """Area of one cell face normal to `axis`."""
        return self.volume_m3 / self.spacing_m[axis]

    def plane(self, axis: int) -> tuple[int, int]:
        """Cells along the two other axes."""
        first, second = (a for a in AXES if a != axis)
        return self.cells[first], self.cells[second]

    def faces_m(self, axis: int) -> Float[np.ndarray, " faces"]:
        """Coordinates of the faces normal to `axis`, both walls included."""
        return self.lower_m[axis] + self.spacing_m[axis] * np.arange(self.cells[axis] + 1)

    def centres_m(self, axis: int) -> Float[np.ndarray, " cells"]:
        """Coordinates of the cell centres."""
        return self.lower_m[axis] + self.spacing_m[axis] * (np.arange(self.cells[axis]) + 0.5)


def room_grid(room: Box, cells: int, edges_m: tuple[tuple[float, ...], ...] = ((), (), ())) -> RoomGrid:
    """Nearly cubic cells, about cells^3 of them, and at least 4 along every axis.

    An axis may have up to a tenth more cells where more of `edges_m` (of openings, an axis) then lie on faces.
    """
    edge = float(np.prod(room.size_m)) ** (1 / 3) / cells
    nx, ny, nz = (
        _aligned(max(4, round(size / edge)), [(e - low) / size for e in edges])
        for size, low, edges in zip(room.size_m, room.lower_m, edges_m, strict=True)
    )
    lx, ly, lz = room.size_m
    return RoomGrid(cells=(nx, ny, nz), lower_m=room.lower_m, spacing_m=(lx / nx, ly / ny, lz / nz))


def _aligned(least: int, shares: list[float]) -> int:
    """The number of cells with the least sum of distances from edges, given as shares of the axis, to faces."""

    def apart(cells: int) -> float:
        return sum((abs(cells * share - round(cells * share)) for share in shares), start=0.0)

    # Distances below a tenth of a cell count as none.
    return min(range(least, least + least // 10 + 1), key=lambda cells: (round(apart(cells), 1), cells))


def cut(field: Float[Array, "..."], start: int, stop: int, axis: int) -> Float[Array, "..."]:
    """`field[start : n + stop]` along one axis; `stop` counts from the end (0 is all)."""
    return lax.slice_in_dim(field, start, field.shape[axis] + stop, axis=axis)


def face_mean(field: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    """Mean of neighbours along `axis`: one shorter."""
    return 0.5 * (cut(field, 0, -1, axis) + cut(field, 1, 0, axis))


def difference(field: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    """Forward difference along `axis`: one shorter."""
    return cut(field, 1, 0, axis) - cut(field, 0, -1, axis)


def stored(field: Float[Array, "..."]) -> Float[Array, "..."]:
    """`field`, stored: else XLA would concatenate it again in every loop that reads it."""
    return lax.optimization_barrier(field)


def with_walls(
    low: Float[Array, "..."], inner: Float[Array, "..."], high: Float[Array, "..."], axis: int
) -> Float[Array, "..."]:
    """`inner` between two wall planes, given without the axis."""
    planes = jnp.expand_dims(low, axis), jnp.expand_dims(high, axis)
    return stored(jnp.concatenate([planes[0], stored(inner), planes[1]], axis))


def closed(field: Cells) -> Float[Array, "nx2 ny2 nz2"]:
    """A diffusivity with one ghost cell beyond every wall that makes its mean on the wall zero."""
    for a in AXES:
        low, high = cut(field, 0, 1 - field.shape[a], a), cut(field, field.shape[a] - 1, 0, a)
        field = stored(jnp.concatenate([-low, field, -high], a))
    return field


def within(field: Float[Array, "..."], ghosts: tuple[int, ...]) -> Float[Array, "..."]:
    """`field` without its outermost cells along these axes."""
    for a in ghosts:
        field = cut(field, 1, -1, a)
    return field


def first_plane(field: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    """The plane next to the lower wall."""
    return lax.index_in_dim(field, 0, axis, keepdims=False)


def last_plane(field: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    """The plane next to the upper wall."""
    return lax.index_in_dim(field, field.shape[axis] - 1, axis, keepdims=False)
