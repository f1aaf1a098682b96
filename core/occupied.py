"""The part of a room where people are, and what a field is like there."""

import numpy as np
from jaxtyping import Bool, Float

from core.geometry import Box, Vector3
from core.setting import SettingError, check_range, setting

# Sitting people's ankles and heads above the floor (ISO 7730:2005, 6.3).
ANKLE_M, HEAD_M = 0.1, 1.1

Axis = Float[np.ndarray, " _"]
Volume = Float[np.ndarray, "nx ny nz"]


@setting
class OccupiedZone:
    """As far from the walls, and between these heights above the floor (EN 16798-3 takes 0.6, 0.1 and 1.8 m)."""

    from_walls_m: float = 0.6
    lowest_m: float = 0.1
    highest_m: float = 1.8

    def __post_init__(self) -> None:
        check_range("The zone's distance from walls", self.from_walls_m, 0.0, 100.0, "m", "Give metres.")
        check_range("The zone's lower height", self.lowest_m, 0.0, 100.0, "m", "Give metres.")
        check_range(
            "The zone's upper height", self.highest_m, self.lowest_m, 100.0, "m",
            "It is above the lower one.",
        )  # fmt: skip

    def box(self, room: Box) -> tuple[Vector3, Vector3]:
        """Its lower and upper corner. Raises SettingError where it leaves nothing of the room."""
        (x0, y0, z0), (x1, y1, z1) = room.lower_m, room.upper_m
        gap_m = self.from_walls_m
        low: Vector3 = (x0 + gap_m, y0 + gap_m, z0 + self.lowest_m)
        high: Vector3 = (x1 - gap_m, y1 - gap_m, min(z0 + self.highest_m, z1))
        if not all(a < b for a, b in zip(low, high, strict=True)):
            sx, sy, sz = room.size_m
            raise SettingError(
                f"The room is {sx:g} x {sy:g} x {sz:g} m: nothing of it is {gap_m:g} m from its walls and "
                f"{self.lowest_m:g} m above its floor. Give a smaller distance from the walls."
            )
        return low, high


def inside(axes_m: tuple[Axis, Axis, Axis], low_m: Vector3, high_m: Vector3) -> Bool[np.ndarray, "nx ny nz"]:
    """Which vertices lie in a box; those next to its middle along an axis on which none does."""
    chosen = []
    for axis, low, high in zip(axes_m, low_m, high_m, strict=True):
        within = (axis >= low - 1e-6) & (axis <= high + 1e-6)
        if not within.any():
            within[int(np.argmin(np.abs(axis - 0.5 * (low + high))))] = True
        chosen.append(within)
    return chosen[0][:, None, None] & chosen[1][:, None] & chosen[2]


def at_height(field: Volume, z_m: Axis, height_m: float) -> Float[np.ndarray, "nx ny"]:
    """A field on the plane at this height above the lowest vertex, linear between vertices."""
    place = np.clip(height_m / (z_m[1] - z_m[0]), 0.0, len(z_m) - 1.0)
    below = min(int(place), len(z_m) - 2)
    share = place - below
    return field[:, :, below] * (1.0 - share) + field[:, :, below + 1] * share
