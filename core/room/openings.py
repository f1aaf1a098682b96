"""Patches on cell faces: exact covered fractions, and what a patch may not be."""

from itertools import combinations

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.geometry import Box
from core.room.room_grid import AXES, WALLS, RoomGrid
from core.scene import Inlet, Outlet, Patch, Scene, Wall
from core.setting import SettingError

C_MU = 0.09


class Opening(eqx.Module):
    """A patch on cell faces: the fraction of each face that it covers."""

    wall: int = eqx.field(static=True)
    fraction: Float[np.ndarray, "first second"]
    area_m2: float = eqx.field(static=True)

    @property
    def axis(self) -> int:
        """Axis normal to the wall."""
        return self.wall // 2

    @property
    def inward(self) -> float:
        """+1 on a lower wall, -1 on an upper one."""
        return 1.0 if self.wall % 2 == 0 else -1.0


def lay_patch(patch: Patch, room: Box, grid: RoomGrid, notes: list[str]) -> Opening:
    """`patch` on the faces of its wall; adds a sentence to `notes` where the grid cannot hold it.

    Raises:
        SettingError: the patch has no area or leaves its wall.
    """
    wall = WALLS.index(patch.wall)
    first, second = (a for a in AXES if a != wall // 2)
    for a, low, high in zip((first, second), patch.lower_m, patch.upper_m, strict=True):
        if not (room.lower_m[a] - 1e-6 <= low < high <= room.upper_m[a] + 1e-6):
            raise SettingError(
                f"A patch on {patch.wall} spans {low:g} to {high:g} m along {'xyz'[a]}; the wall spans "
                f"{room.lower_m[a]:g} to {room.upper_m[a]:g} m. Give lower_m below upper_m, on the wall."
            )
        if high - low < grid.spacing_m[a]:
            notes.append(
                f"The patch on {patch.wall} is {high - low:.3g} m wide along {'xyz'[a]}, less than the "
                f"cells' {grid.spacing_m[a]:.3g} m: its flow and momentum are kept, its shape is not. "
                "Use a finer grid."
            )
    covered = np.outer(
        _overlap(grid, first, patch.lower_m[0], patch.upper_m[0]),
        _overlap(grid, second, patch.lower_m[1], patch.upper_m[1]),
    )
    area = (patch.upper_m[0] - patch.lower_m[0]) * (patch.upper_m[1] - patch.lower_m[1])
    return Opening(wall, covered, area)


def opening_edges_m(scene: Scene) -> tuple[tuple[float, ...], ...]:
    """Where inlets and outlets begin and end along each axis [m]: a face there keeps a jet's first profile."""
    edges: tuple[list[float], ...] = ([], [], [])
    for part in scene.boundary:
        if isinstance(part, Inlet | Outlet):
            along = [a for a in AXES if a != WALLS.index(part.patch.wall) // 2]
            for a, low, high in zip(along, part.patch.lower_m, part.patch.upper_m, strict=True):
                edges[a].extend((low, high))
    return tuple(tuple(e) for e in edges)


def refuse_overlaps(patches: list[Patch]) -> None:
    """Raise SettingError if two patches of a wall share area."""
    for one, other in combinations(patches, 2):
        if share_area(one, other):
            raise SettingError(
                f"Two patches on {one.wall} overlap: {one.lower_m} to {one.upper_m} and {other.lower_m} to "
                f"{other.upper_m} m. Move them apart: a face is an inlet, an outlet or a heater."
            )


def share_area(one: Patch, other: Patch) -> bool:
    """Whether two patches lie over one another."""
    shared = [
        min(h1, h2) - max(l1, l2)
        for l1, h1, l2, h2 in zip(one.lower_m, one.upper_m, other.lower_m, other.upper_m, strict=True)
    ]
    return one.wall == other.wall and min(shared) > 1e-9


def refuse_outward(inlet: Inlet, opening: Opening) -> None:
    """Raise SettingError if the supply points out of the room."""
    if opening.inward * inlet.velocity_m_s[opening.axis] <= 0:
        raise SettingError(
            f"The inlet on {inlet.patch.wall} supplies air at {inlet.velocity_m_s} m/s, which does not "
            f"enter the room. Give a velocity with {'xyz'[opening.axis]} "
            f"{'> 0' if opening.inward > 0 else '< 0'}, or make the patch an outlet."
        )


def stated_walls(scene: Scene) -> dict[str, Wall | None]:
    """The scene's walls by name; None where nothing is stated.

    Raises:
        SettingError: a wall stated twice and differently.
    """
    walls: dict[str, Wall | None] = dict.fromkeys(WALLS)
    for part in scene.boundary:
        if isinstance(part, Wall):
            before = walls[part.wall]
            if before is not None and before != part:
                raise SettingError(
                    f"The wall {part.wall} is stated twice: {before.thermal} at {before.temperature_k} K and "
                    f"{part.thermal} at {part.temperature_k} K. Keep one."
                )
            walls[part.wall] = part
    return walls


def supply_turbulence(inlet: Inlet) -> tuple[float, float]:
    """k [m2/s2] and epsilon [m2/s3] of the supply."""
    length_m = inlet.length_scale_m or 0.07 * inlet.patch.hydraulic_diameter_m
    speed = float(np.linalg.norm(inlet.velocity_m_s))
    k = 1.5 * (inlet.turbulence_intensity * speed) ** 2
    return k, C_MU**0.75 * k**1.5 / length_m


def _overlap(grid: RoomGrid, axis: int, low_m: float, high_m: float) -> Float[np.ndarray, " cells"]:
    """Fraction of each cell's edge along `axis` within the bounds."""
    faces = grid.faces_m(axis)
    shared = np.minimum(faces[1:], high_m) - np.maximum(faces[:-1], low_m)
    return np.clip(shared / grid.spacing_m[axis], 0.0, 1.0)
