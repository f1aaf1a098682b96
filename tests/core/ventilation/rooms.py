"""Found flows of known answers, on the vertices of a box of 4 x 3 x 2 m."""

from importlib.resources import files
from pathlib import Path

import numpy as np

from app.volume.file import read_volume
from core.result import Solution
from core.scene import Patch

SIZE_M = (4.0, 3.0, 2.0)
INLET = Patch(wall="x_min", lower_m=(1.0, 1.5), upper_m=(2.0, 2.0))
OUTLET = Patch(wall="x_max", lower_m=(1.0, 0.0), upper_m=(2.0, 0.5))
# The packaged room's openings, supply and volume flow, as it states them.
TRUE_PATCHES = (
    Patch(wall="x_min", lower_m=(-0.3, 1.6), upper_m=(0.3, 1.8)),
    Patch(wall="x_min", lower_m=(-0.3, 0.2), upper_m=(0.3, 0.6)),
)
TRUE_FLOW_M3_S = 0.06


def box(velocity_m_s: np.ndarray, temperature_k: float | np.ndarray = 293.0) -> Solution:
    """A solution on even vertices of the box."""
    shape = velocity_m_s.shape[:3]
    x, y, z = (np.linspace(0.0, size, n) for size, n in zip(SIZE_M, shape, strict=True))
    return Solution(x, y, z, np.broadcast_to(temperature_k, shape).astype(float), velocity_m_s=velocity_m_s)


def plug(cells: int, speed_m_s: float = 0.1) -> Solution:
    """All air moves along x, through the whole of both walls."""
    velocity = np.zeros((cells + 1, 7, 7, 3))
    velocity[..., 0] = speed_m_s
    return box(velocity)


def ventilated(cells: int = 12) -> Solution:
    """Air enters high on the left and leaves low on the right; between them only noise is found."""
    velocity = 0.02 * np.random.default_rng(0).standard_normal((cells + 1, cells + 1, cells + 1, 3))
    found = box(velocity)
    inside = {}
    for name, patch in (("in", INLET), ("out", OUTLET)):
        sides = [
            (axis >= low) & (axis <= high)
            for axis, low, high in zip((found.y_m, found.z_m), patch.lower_m, patch.upper_m, strict=True)
        ]
        inside[name] = np.outer(*sides)
    velocity[0, ..., 0], velocity[-1, ..., 0] = 0.2 * inside["in"], 0.19 * inside["out"]
    return found


def packaged() -> Solution:
    """The truth of the packaged room."""
    room = read_volume(Path(str(files("app.simulate.sample") / "room.npz")))
    return Solution(room.x_m, room.y_m, room.z_m, room.temperature_k, velocity_m_s=room.velocity_m_s)
