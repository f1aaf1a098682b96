"""A room as blocks for a mesh: cut at every plane of an object's face, the objects' own blocks left out.

So each object's faces are faces of the mesh exactly, whatever the result's vertices are. The blocks' cells are as
large as the result's, or smaller where a block is. `n` objects cut a room into at most (2 n + 1)^3 blocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.errors import BadInputError
from core.objects import RoomObject

Axes = tuple[Float[np.ndarray, " nx"], Float[np.ndarray, " ny"], Float[np.ndarray, " nz"]]
# Planes that are nearer to one another are one.
_SAME_M = 1e-5


@dataclass(frozen=True)
class Side:
    """One face of a block of air: on a wall (`solid` is -1, `number` that of `WALLS`), or on object `solid`.

    `number` counts as `WALLS` do: x low, x high, y low, ... `block` is an index of the blocks along x, y and z.
    """

    block: tuple[int, int, int]
    number: int
    solid: int = -1


@dataclass(frozen=True)
class Blocks:
    """Blocks between the planes of each axis [m], so many `cells` in each; `owner`: a block's object, -1 for air."""

    planes_m: tuple[Float[np.ndarray, " px"], Float[np.ndarray, " py"], Float[np.ndarray, " pz"]]
    cells: tuple[Int[np.ndarray, " bx"], Int[np.ndarray, " by"], Int[np.ndarray, " bz"]]
    owner: Int[np.ndarray, "bx by bz"]

    @property
    def air(self) -> list[tuple[int, int, int]]:
        """The blocks that hold air, x fastest."""
        return [(int(x), int(y), int(z)) for z, y, x in np.argwhere(self.owner.T < 0)]

    def centres_m(self, axis: int) -> Float[np.ndarray, " cells"]:
        """The cells' middles along an axis, through all blocks, those of objects too."""
        planes, counts = self.planes_m[axis], self.cells[axis]
        parts = [
            low + (high - low) * (np.arange(count) + 0.5) / count
            for low, high, count in zip(planes[:-1], planes[1:], counts, strict=True)
        ]
        return np.concatenate(parts)

    def cells_of(self, block: tuple[int, int, int]) -> tuple[slice, slice, slice]:
        """Where a block's cells are among all of `centres_m`."""
        x, y, z = (
            slice(int(counts[:i].sum()), int(counts[: i + 1].sum()))
            for counts, i in zip(self.cells, block, strict=True)
        )
        return x, y, z

    def sides(self) -> list[Side]:
        """The faces of the air's blocks that lie on a wall or on an object."""
        beyond = np.pad(self.owner, 1, constant_values=-2)
        found = []
        for block in self.air:
            for number in range(6):
                place = [i + 1 for i in block]
                place[number // 2] += 1 if number % 2 else -1
                other = int(beyond[tuple(place)])
                if other != -1:
                    found.append(Side(block, number, max(other, -1)))
        return found

    def area_m2(self, side: Side) -> float:
        """Area of such a face."""
        sizes_m = [planes[i + 1] - planes[i] for planes, i in zip(self.planes_m, side.block, strict=True)]
        return float(np.prod([size for axis, size in enumerate(sizes_m) if axis != side.number // 2]))


def cut_room(axes_m: Axes, objects: Sequence[RoomObject]) -> Blocks:
    """The room between the ends of evenly spaced vertices [m], cut at the objects.

    Raises BadInputError for an object that is thinner than `_SAME_M`, or leaves no air.
    """
    planes = [_planes(axis_m, objects, a) for a, axis_m in enumerate(axes_m)]
    owner = np.full([len(one) - 1 for one in planes], -1)
    for number, item in enumerate(objects):
        low = [_nearest(planes[a], item.lower_m[a]) for a in range(3)]
        high = [_nearest(planes[a], item.upper_m[a]) for a in range(3)]
        if any(first >= last for first, last in zip(low, high, strict=True)):
            raise BadInputError(
                f"The object {item.name!r} is outside the result or thinner than {1000 * _SAME_M:g} mm, and a mesh "
                "has no cell for it. Make it thicker in experiment.toml, and reconstruct again."
            )
        owner[tuple(slice(first, last) for first, last in zip(low, high, strict=True))] = number
    if (owner >= 0).all():
        raise BadInputError("The objects fill the whole room. Leave air around them, and reconstruct again.")
    x, y, z = (_counts(axis_m, one) for axis_m, one in zip(axes_m, planes, strict=True))
    return Blocks((planes[0], planes[1], planes[2]), (x, y, z), owner)


def _planes(axis_m: Float[np.ndarray, " n"], objects: Sequence[RoomObject], axis: int) -> np.ndarray:
    """The ends of an axis and the objects' faces between them, in order, each once."""
    low, high = float(axis_m[0]), float(axis_m[-1])
    faces = sorted({face for item in objects for face in (item.lower_m[axis], item.upper_m[axis])})
    kept = [low]
    for face in faces:
        if kept[-1] + _SAME_M < face < high - _SAME_M:
            kept.append(face)
    return np.array([*kept, high])


def _nearest(planes_m: np.ndarray, place_m: float) -> int:
    return int(np.argmin(np.abs(planes_m - place_m)))


def _counts(axis_m: Float[np.ndarray, " n"], planes_m: np.ndarray) -> Int[np.ndarray, " blocks"]:
    """Cells in each block: about as large as those between the vertices, one at least."""
    spacing_m = float(axis_m[-1] - axis_m[0]) / (len(axis_m) - 1)
    return np.maximum(1, np.rint(np.diff(planes_m) / spacing_m).astype(int))
