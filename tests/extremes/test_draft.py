"""From shifts to temperature: still air, T in = T0, 2000 K, shifts that no air makes, nothing known."""

from dataclasses import replace

import numpy as np

from core.geometry import Box, looking_along_y
from core.known_temperature import VertexGrid, known_temperature
from core.problem import PlaneData, Problem, SensorData, ShiftMeasurement
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, Scene, SolveModel, View, Wall
from core.solve.check import check_problem
from core.solve.draft.draft import draft_grid, solve_draft
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove

STAGE = "draft"
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
T0 = 293.15
CAMERA = looking_along_y(position_m=(2.0, -5.0, 1.5), width_px=64, height_px=48, focal_px=100.0)
PATCH = Patch(wall="x_min", lower_m=(1.0, 1.0), upper_m=(2.0, 2.0))
CENTRES = np.stack(np.meshgrid(np.linspace(16, 47, 4), np.linspace(12, 35, 4)), -1).reshape(-1, 2)


def scene(*known, room: Box = ROOM, grid: int = 8) -> Scene:
    x, _, z = room.centre_m
    depth_m = 2 * max(room.size_m)
    focal_px = 40.0 * depth_m / room.size_m[0]
    optics = replace(CAMERA, position_m=(x, room.upper_m[1] - depth_m, z), focal_px=(focal_px, focal_px))
    return Scene(
        room=room, views=(View(camera=optics),), light=FixedTexture(pixel_m=room.size_m[0] / 400), boundary=known,
        solve=SolveModel(grid=grid),
    )  # fmt: skip


def shifts(px: float = 0.0, information: float = 1e8, count: int = 16) -> ShiftMeasurement:
    matrix = np.broadcast_to(np.eye(2) * information, (count, 2, 2)).copy()
    return ShiftMeasurement(CENTRES[:count], np.full((count, 2), px), matrix, 8)


def sensor(kelvin: float, place=(2.0, 1.5, 1.5), std_k: float = 0.01) -> SensorData:
    return SensorData(
        np.array([place]), np.array([kelvin]), np.array([std_k]), np.full((1, 3), np.nan), np.array([np.nan])
    )


def plane(kelvin: float, wall: str = "x_min", to_m: float = 3.0) -> PlaneData:
    line = np.linspace(0, to_m, 4)
    return PlaneData(wall, line, line, np.full((4, 4), kelvin), np.zeros((4, 4)), np.zeros((4, 4, 3)))


def solved(name: str, expected, measured: ShiftMeasurement, *, planes=(), sensors=(), world=None) -> Row:
    """Temperature above ambient."""

    def run() -> np.ndarray:
        problem = Problem(world or scene(), (measured,), tuple(planes), tuple(sensors))
        return solve_draft(problem).temperature_k - T0

    return Row(STAGE, name, run, expected)


def level(kelvin: float) -> Row:
    """No shift and one thermometer: that temperature everywhere, exactly mapped at any contrast."""
    # The level is carried by the refractivity at ambient: within 1 %, and the smoothness leaves 2 %.
    return solved(f"one thermometer at T0 + {kelvin:g} K", Near(kelvin, rel=0.05, abs=2e-3), shifts(),
                  sensors=[sensor(T0 + kelvin)])  # fmt: skip


def grid(name: str, size_m: tuple[float, float, float], cells) -> Row:
    """A vertex count for each axis that fits into memory, whatever the box."""

    def run() -> np.ndarray:
        world = scene(room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=size_m))
        return np.array(draft_grid(replace(world, solve=SolveModel(grid=cells))).shape)

    most = 49 if cells == "auto" else cells + 1
    return Row(STAGE, f"grid of {name}", run, Within(2, max(most, 9)))


def checked(
    name: str, words: str, *, known=(), planes=(), sensors=(), regime="bos+pde+boundary", **changed
) -> Row:
    """Refused before the first iteration."""

    def run() -> float:
        measured = replace_fields(shifts(), **changed)
        check_problem(Problem(scene(*known), (measured,), tuple(planes), tuple(sensors)), regime)
        return 0.0

    return Row(STAGE, f"check: {name}", run, Refused(words))


def replace_fields(measured: ShiftMeasurement, **changed) -> ShiftMeasurement:
    given = {name: getattr(measured, name) for name in
             ("centres_px", "displacement_px", "information_per_px2", "window_px")}  # fmt: skip
    return ShiftMeasurement(**(given | changed))


def known(name: str, expected, *parts, planes=()) -> Row:
    def run() -> np.ndarray:
        vertices = VertexGrid(ROOM, (5, 5, 5))
        found = known_temperature(Problem(scene(*parts), (), tuple(planes)), vertices)
        return np.array([k for _, k, _ in found.means] + list(found.temperature_k[found.mask]))

    return Row(STAGE, f"known: {name}", run, expected)


INLET = Inlet(patch=PATCH, temperature_k=303.15, velocity_m_s=(0.5, 0.0, 0.0))
TIGHT = Wall(wall="x_min", thermal="adiabatic")
HALF = np.array([[1e8, 0.0], [0.0, 1e-6]])

ROWS = [
    *[level(k) for k in (0.0, 1e-3, -10.0, 10.0, 100.0)],
    solved("still air beside a plane at T0", Near(0.0, abs=2e-3), shifts(), planes=[plane(T0)],
           world=scene(TIGHT)),
    solved("a plane on a wall and nothing else", Refused("level of the temperature"), shifts(), planes=[plane(T0)]),
    solved("T in = T0", Near(0.0, abs=2e-3), shifts(), world=scene(replace(INLET, temperature_k=T0))),
    solved("a plane at 2000 K", Within(-50.0, 5000.0), shifts(), planes=[plane(T0 + 1700.0)],
           world=scene(TIGHT)),
    solved("shifts of 1e-6 px", Within(-1.0, 1.0), shifts(1e-6), sensors=[sensor(T0)]),
    solved("shifts of 10 px", Within(-293.15, 5000.0), shifts(10.0), sensors=[sensor(T0)]),
    solved("shifts that know nothing", Refused("no shift better than 1 px"), shifts(0.3, 1e-6), sensors=[sensor(T0)]),
    solved("one window", Near(0.0, abs=2e-3), shifts(0.0, 1e8, 1), sensors=[sensor(T0)]),
    solved("windows that know one direction", Near(0.0, abs=2e-3),
           replace_fields(shifts(), information_per_px2=np.broadcast_to(HALF, (16, 2, 2)).copy()),
           sensors=[sensor(T0)]),
    solved("nothing known", Refused("level of the temperature"), shifts()),
    solved("shifts that are NaN", Refused("not finite"), shifts(float("nan")), sensors=[sensor(T0)]),
    solved("no windows", Refused("no window"), shifts(0.0, 1e8, 0), sensors=[sensor(T0)]),
    solved("a thermometer outside the room", Refused("outside the room"), shifts(),
           sensors=[sensor(T0, (9.0, 1.0, 1.0))]),
    solved("a thermometer on the wall", Near(0.0, abs=2e-3), shifts(), sensors=[sensor(T0, (0.0, 1.5, 1.5))]),
    grid("a cube of 1 cm", (0.01, 0.01, 0.01), "auto"),
    grid("a hall of 100 m", (100.0, 100.0, 100.0), "auto"),
    grid("a corridor of 100 m", (100.0, 1.0, 1.0), "auto"),
    grid("a slot of 1 cm", (4.0, 3.0, 0.01), "auto"),
    grid("two cells", (4.0, 3.0, 3.0), 2),
    checked("shifts that are NaN", "not finite", displacement_px=np.full((16, 2), np.nan), sensors=[sensor(T0)]),
    checked("no window", "sees no window", centres_px=np.zeros((0, 2)), displacement_px=np.zeros((0, 2)),
            information_per_px2=np.zeros((0, 2, 2))),
    checked("no texture", "no window with texture", information_per_px2=np.zeros((16, 2, 2))),
    checked("no noise", "noise is zero", information_per_px2=np.full((16, 2, 2), np.eye(2) * 1e18)),
    checked("saturated images", "no shift better than 1 px", 
            information_per_px2=np.full((16, 2, 2), np.eye(2) * 1e-3)),
    checked("nothing at the boundary", "undetermined"),
    checked("a plane twice", "2 times", planes=[plane(T0), plane(T0)]),
    checked("a plane of NaN", "not finite", planes=[plane(float("nan"))]),
    checked("a plane in Celsius below 0", "kelvin", planes=[plane(-5.0)]),
    checked("a thermometer known exactly", "uncertainty 0", sensors=[sensor(T0, std_k=0.0)]),
    checked("a thermometer in millimetres", "outside the room", sensors=[sensor(T0, (2000.0, 1500.0, 1500.0))]),
    checked("a wall described twice", "describe it once", known=(Wall(wall="x_max"), Wall(wall="x_max"))),
    checked("supply that leaves", "does not enter the room", known=(replace(INLET, velocity_m_s=(-0.5, 0.0, 0.0)),)),
    checked("an inlet on an outlet", "overlap", known=(INLET, Outlet(patch=PATCH))),
    known("a plane on a wall", Near(300.0), TIGHT, planes=[plane(300.0)]),
    checked("an inlet against its plane", "Correct the one that is wrong", known=(INLET,), planes=[plane(T0)]),
    checked("a heater against its plane", "Correct the one that is wrong", planes=[plane(T0)],
            known=(Heater(patch=PATCH, temperature_k=320.0),)),
    # Between the supply and the air at rest.
    known("an inlet alone", Near(0.5 * (303.15 + T0)), INLET),
    known("an outlet smaller than a cell", Near(299.0),
          Outlet(patch=Patch(wall="x_max", lower_m=(1.0, 1.0), upper_m=(1.001, 1.001)), mean_temperature_k=299.0)),
]  # fmt: skip


@extremes(ROWS)
def test_the_draft_at_its_limits(row: Row, record_property):
    prove(row, record_property)
