"""Patches on cell faces: exact covered fractions, and the turbulence of supply air."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.geometry import WALLS, Box, face_of
from core.room.k_epsilon import C_MU
from core.room.room_grid import AXES, RoomGrid
from core.scene import Inlet, Outlet, Patch, Scene
from core.setting import SettingError


class Opening(eqx.Module):
    """A patch on cell faces: the fraction of each face that it covers."""

    wall: int = eqx.field(static=True)
    fraction: Float[np.ndarray, "first second"]
    area_m2: float = eqx.field(static=True)

    @property
    def axis(self) -> int:
        """Axis normal to the wall."""
        return face_of(WALLS[self.wall]).axis

    @property
    def inward(self) -> float:
        """+1 on a lower wall, -1 on an upper one."""
        return face_of(WALLS[self.wall]).inward


def lay_patch(patch: Patch, room: Box, grid: RoomGrid, notes: list[str]) -> Opening:
    """`patch` on the cell faces of its wall; adds a sentence to `notes` if it is smaller than a cell.

    Raises:
        SettingError: the patch has no area or leaves its wall.
    """
    face = face_of(patch.wall)
    first, second = face.along
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
    return Opening(face.number, covered, patch.area_m2)


def opening_edges_m(scene: Scene) -> tuple[tuple[float, ...], ...]:
    """Edges of openings and objects along each axis [m]: cell faces there keep a jet's profile at its opening."""
    edges: tuple[list[float], ...] = ([], [], [])
    for part in scene.boundary:
        if isinstance(part, Inlet | Outlet):
            for a, low, high in zip(
                face_of(part.patch.wall).along, part.patch.lower_m, part.patch.upper_m, strict=True
            ):
                edges[a].extend((low, high))
    for item in scene.objects:
        for a in AXES:
            edges[a].extend((item.lower_m[a], item.upper_m[a]))
    return tuple(tuple(e) for e in edges)


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
