"""The marched room on a few cells: still air, 0.001 to 2000 K, boxes of 1 cm and 100 m, Re to 1e7."""

from functools import cache

import jax.numpy as jnp
import numpy as np

from core.estimate.prior import room_prior
from core.geometry import WALLS, Box, face_of, looking_along_y
from core.problem import Problem
from core.room.boundary_conditions import boundary, room_layout
from core.room.closure import ConstantClosure
from core.room.march import MarchSettings, march
from core.room.room_grid import RoomGrid, room_grid
from core.room.step import air_at_rest, room_model
from core.room.wall_planes import closed_room
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, Scene, View, Wall
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove

STAGE = "room"
SIDES = {"1 m": 1.0, "1 cm": 0.01, "100 m": 100.0}


@cache
def marched(
    side: str, kelvin: float, viscosity_m2_s: float, *, steady: bool = False
) -> tuple[np.ndarray, float]:
    """Warm air below cold in a closed box, for a tenth of its turnover: excess over `kelvin`, and speed."""
    size_m = SIDES[side]
    grid = RoomGrid(cells=(4, 4, 4), lower_m=(0.0, 0.0, 0.0), spacing_m=(size_m / 4,) * 3)
    closure = ConstantClosure(jnp.float32(viscosity_m2_s), jnp.float32(1.5e-5))
    model = room_model(grid, closed_room(grid), closure, buoyancy_m_s2_k=9.81 / 293.15, molecular_m2_s=1.5e-5)
    start = np.zeros((4, 4, 4), np.float32)
    start[1:3, 1:3, 0] = kelvin
    free_fall_s = (size_m / (9.81 * max(kelvin, 1e-3) / 293.15)) ** 0.5
    settings = MarchSettings(
        longest_s=free_fall_s,
        window_s=free_fall_s / 2,
        tolerance=1e-9,
        level_ahead_s=0.0,
        chunk_steps=4,
        steady=steady,
    )
    end = march(air_at_rest(model, jnp.asarray(start), 0.1), model, settings)
    speed_m_s = max(float(jnp.abs(c).max()) for c in end.last.velocity)
    return np.asarray(end.last.excess_k) / max(kelvin, 1e-30), speed_m_s / (size_m / free_fall_s)


def bounded(side: str, kelvin: float, viscosity_m2_s: float, *, steady: bool) -> Row:
    """Nothing becomes hotter than the hottest, colder than the coldest."""
    name = (
        f"{kelvin:g} K in {side}, eddy viscosity {viscosity_m2_s:g}, {'own steps' if steady else 'in time'}"
    )
    run = lambda: marched(side, kelvin, viscosity_m2_s, steady=steady)[0]  # noqa: E731
    return Row(STAGE, f"{name}: within its bounds", run, Within(-1e-4, 1.0001))


def kept(side: str, kelvin: float, viscosity_m2_s: float) -> Row:
    """A closed room keeps its heat while its march is true in time."""
    name = f"{kelvin:g} K in {side}, eddy viscosity {viscosity_m2_s:g}"
    run = lambda: float(marched(side, kelvin, viscosity_m2_s)[0].sum())  # noqa: E731
    return Row(STAGE, f"{name}: keeps its heat", run, Near(4.0, rel=1e-4))


def moves(side: str, kelvin: float, expected: Near | Within) -> Row:
    """Speed over the free fall's."""
    return Row(STAGE, f"{kelvin:g} K in {side}: speed", lambda: marched(side, kelvin, 0.0)[1], expected)


ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.5))
LOW, HIGH = (1.0, 1.0), (2.0, 2.0)


def inlet(
    wall: str = "x_min", velocity_m_s=(0.5, 0.0, 0.0), lower_m=LOW, upper_m=HIGH, kelvin=303.15
) -> Inlet:
    patch = Patch(wall=wall, lower_m=lower_m, upper_m=upper_m)  # type: ignore[arg-type]
    return Inlet(patch=patch, temperature_k=kelvin, velocity_m_s=velocity_m_s)


def outlet(lower_m=(3.0, 1.0), upper_m=(3.5, 2.0)) -> Outlet:
    return Outlet(patch=Patch(wall="z_min", lower_m=lower_m, upper_m=upper_m))


def laid(name: str, expected, *parts, cells: int = 4, room: Box = ROOM) -> Row:
    """The volume flow that enters through the cells' faces of a scene laid on a grid, m3/s."""

    def run() -> float:
        camera = looking_along_y(
            position_m=(room.upper_m[0] / 2, -5.0, 1.2), width_px=40, height_px=30, focal_px=60.0
        )
        scene = Scene(room=room, views=(View(camera=camera),), light=FixedTexture(), boundary=parts)
        layout = room_layout(scene, room_grid(room, cells))
        walls = boundary(layout, room_prior(Problem(scene, ()), layout).mean).walls
        entering = [
            np.maximum(face_of(name).inward * np.asarray(wall.normal_m_s, float), 0.0).sum()
            * layout.grid.face_area_m2(face_of(name).axis)
            for name, wall in zip(WALLS, (side for pair in walls for side in pair), strict=True)
        ]
        return float(sum(entering))

    return Row(STAGE, f"boundary: {name}", run, expected)


CASES = [("1 m", 0.0, 0.0), ("1 m", 1e-3, 0.0), ("1 m", 10.0, 0.0), ("1 m", 2000.0, 0.0), ("1 m", 10.0, 1e-3),
         ("1 m", 10.0, 10.0), ("1 cm", 10.0, 0.0), ("1 cm", 2000.0, 0.0), ("100 m", 1e-3, 0.0),
         ("100 m", 2000.0, 0.0)]  # fmt: skip

ROWS = [
    *[bounded(*case, steady=steady) for case in CASES for steady in (False, True)],
    *[kept(*case) for case in CASES if case[1] > 0],
    moves("1 m", 0.0, Within(0.0, 0.0)),
    # In free fall's time and speed the flow is the same at every size: 0.1964 to 0.1967, as viscosity matters less.
    moves("1 m", 10.0, Near(0.1966, rel=0.003)),
    moves("1 m", 2000.0, Near(0.1966, rel=0.003)),
    moves("100 m", 2000.0, Near(0.1966, rel=0.003)),
    laid("an inlet and an outlet", Near(0.5, rel=1e-6), inlet(), outlet()),
    laid("nothing stated", Near(0.0)),
    laid("an inlet of 1 mm", Near(5e-7, rel=1e-5), inlet(lower_m=(1.0, 1.0), upper_m=(1.001, 1.001)), outlet()),
    laid("an inlet as large as its wall", Near(3.75, rel=1e-6),
         inlet(lower_m=(0.0, 0.0), upper_m=(3.0, 2.5)), outlet()),
    laid("T in = T0", Near(0.5, rel=1e-6), inlet(kelvin=293.15), outlet()),
    laid("in, but not out", Refused("cannot leave"), inlet()),
    laid("out of the room", Refused("does not enter"), inlet(velocity_m_s=(-0.5, 0.0, 0.0)), outlet()),
    laid("still supply", Refused("does not enter"), inlet(velocity_m_s=(0.0, 0.0, 0.0)), outlet()),
    laid("a patch in millimetres", Refused("the wall spans"), 
         inlet(lower_m=(1000.0, 1000.0), upper_m=(2000.0, 2000.0)), outlet()),
    laid("patches on each other", Refused("overlap"), inlet(), outlet(), outlet((3.2, 1.2), (3.9, 1.9))),
    laid("a heater under the outlet", Refused("overlap"), outlet(),
         Heater(patch=Patch(wall="z_min", lower_m=(3.0, 1.0), upper_m=(3.1, 1.1)), temperature_k=310.0)),
    laid("a wall of two temperatures", Refused("describe it once"),
         Wall(wall="x_max", thermal="temperature", temperature_k=290.0),
         Wall(wall="x_max", thermal="temperature", temperature_k=291.0)),
    laid("a room of one cell an axis", Near(0.5, rel=1e-6), inlet(), outlet(), cells=1),
    Row(STAGE, "a march beyond the stable Courant number", lambda: MarchSettings(courant=1.0).courant,
        Refused("stable from 0 to")),
    Row(STAGE, "a march of no time", lambda: MarchSettings(longest_s=0.0).longest_s, Refused("cannot be watched")),
    Row(STAGE, "windows of no time", lambda: MarchSettings(window_s=0.0).window_s, Refused("cannot be watched")),
]  # fmt: skip


@extremes(ROWS)
def test_rooms_at_their_limits(row: Row, record_property):
    prove(row, record_property)
