"""The air's known temperature: a plane on a wall tells the wall's, but where air leaves or no heat passes."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.known_temperature import KnownTemperature, VertexGrid, known_temperature
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, Scene, View, Wall
from core.setting import SettingError
from core.solve.draft.draft import solve_draft

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
CAMERA = looking_along_y(position_m=(2.0, -27.0, 1.5), width_px=80, height_px=60, focal_px=600.0)
GRID = VertexGrid(ROOM, (17, 13, 13))
WALL_K, SUPPLY_K, LEAVING_K = 290.0, 300.0, 295.0
IN = Patch(wall="x_min", lower_m=(1.0, 2.0), upper_m=(2.0, 2.5))
OUT = Patch(wall="x_min", lower_m=(1.0, 0.5), upper_m=(2.0, 1.0))


def scene(*boundary) -> Scene:
    return Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), boundary=boundary)


def plane(*, enters: bool = False, leaves: bool = False) -> PlaneData:
    """The wall x_min as a camera for heat and an anemometer would have it."""
    y_m, z_m = np.linspace(0.0, 3.0, 25), np.linspace(0.0, 3.0, 25)
    kelvin, velocity = np.full((25, 25), WALL_K), np.zeros((25, 25, 3))
    for wanted, patch, value, speed in ((enters, IN, SUPPLY_K, 0.4), (leaves, OUT, LEAVING_K, -0.4)):
        if wanted:
            inside = [
                (axis >= low) & (axis <= high)
                for axis, low, high in zip((y_m, z_m), patch.lower_m, patch.upper_m, strict=True)
            ]
            kelvin[np.outer(*inside)], velocity[np.outer(*inside), 0] = value, speed
    return PlaneData("x_min", y_m, z_m, kelvin, np.zeros((25, 25)), velocity)


def known(planes: PlaneData, *boundary) -> KnownTemperature:
    return known_temperature(Problem(scene(*boundary), (), (planes,)), GRID)


def test_a_plane_on_a_wall_tells_what_leaves_by_it_and_nothing_else():
    for walls in ((), (Wall(wall="x_min", thermal="temperature", temperature_k=WALL_K),)):
        found = known(plane(enters=True, leaves=True), *walls)
        assert not found.mask.any()
        ((members, kelvin, std_k),) = found.means
        assert kelvin == pytest.approx(LEAVING_K)
        assert std_k < 0.1
        x, y, z = np.unravel_index(members, GRID.shape)
        assert set(x) == {0}
        assert {GRID.axes_m[2][n] for n in z} <= {0.5, 0.75, 1.0}
        assert len(members) == len(set(y)) * len(set(z))


def test_a_wall_that_passes_no_heat_is_as_warm_as_the_air_beside_it_but_for_supplies_and_heaters():
    heated = Patch(wall="x_min", lower_m=(0.5, 0.5), upper_m=(0.75, 1.0))
    found = known(
        plane(enters=True, leaves=True),
        Wall(wall="x_min", thermal="adiabatic"),
        Heater(patch=heated, temperature_k=320.0),
    )
    assert not found.means
    beside, kelvin = found.mask[0], found.temperature_k[0]
    assert not found.mask[1:].any()
    assert set(kelvin[beside]) == {WALL_K, LEAVING_K}
    assert not beside[4:9, 8:11].any()
    assert not beside[2:4, 2:5].any()
    # The wall's inner vertices but for 5 x 3 in the supply and 2 x 3 on the heater.
    assert beside.sum() == 11 * 11 - 15 - 6


def test_supplies_alone_say_between_what_the_air_lies():
    supply = Inlet(patch=IN, temperature_k=SUPPLY_K, velocity_m_s=(0.4, 0.0, 0.0))
    for problem in (Problem(scene(supply), ()), Problem(scene(), (), (plane(enters=True),))):
        low_k = min(
            [problem.scene.air.ambient_temperature_k, *(p.temperature_k.min() for p in problem.planes)]
        )
        ((members, kelvin, std_k),) = known_temperature(problem, GRID).means
        assert len(members) == np.prod(GRID.shape)
        assert kelvin == pytest.approx(0.5 * (low_k + SUPPLY_K))
        assert std_k == pytest.approx((SUPPLY_K - low_k) / np.sqrt(12))


@pytest.fixture(scope="module")
def still() -> ShiftMeasurement:
    """Windows that have not moved."""
    places = np.meshgrid(np.arange(4.5, 80, 8), np.arange(4.5, 60, 8))
    centres = np.stack(places, -1).reshape(-1, 2)
    information = np.broadcast_to(np.eye(2) * 1e8, (len(centres), 2, 2)).copy()
    return ShiftMeasurement(centres, np.zeros((len(centres), 2)), information, 8)


def test_a_cold_wall_does_not_make_the_air_of_a_draft_cold(still):
    stated = (
        Wall(wall="x_min", thermal="temperature", temperature_k=WALL_K),
        Outlet(patch=replace(OUT, wall="x_max"), mean_temperature_k=LEAVING_K, temperature_std_k=0.1),
    )
    found = solve_draft(Problem(scene(*stated), (still,), (plane(),)))
    assert float(np.median(found.temperature_k)) == pytest.approx(LEAVING_K, abs=0.5)


def test_a_wall_alone_does_not_tell_how_warm_the_air_is(still):
    with pytest.raises(SettingError, match=r"Nothing fixes the level .* a plane field that air passes"):
        solve_draft(Problem(scene(), (still,), (plane(),)))
