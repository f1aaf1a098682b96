import numpy as np
import pytest

from core.estimate.plane_openings import (
    plane_openings,
    refuse_walls_alone,
    still_vertices,
    with_planes_read,
)
from core.estimate.prior import room_prior
from core.geometry import WALLS, Box, looking_along_y
from core.known import unknown_walls
from core.problem import PlaneData, Problem, SensorData
from core.room.boundary_conditions import MeasuredWall
from core.room.forward import room
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, PlaneField, Scene, View, Wall
from core.setting import SettingError

Y, Z = np.linspace(-1.5, 1.5, 61), np.linspace(0.0, 3.0, 61)
CLOSED = tuple(Wall(wall=name, thermal="adiabatic") for name in WALLS)


def plane() -> PlaneData:
    """A supply of 0.4 m/s at 300 K over 0.55 x 0.15 m, and an exhaust; edges are smeared over one spacing."""
    velocity = np.zeros((61, 61, 3))
    temperature = np.full((61, 61), 295.0)
    supply = np.outer(np.abs(Y) <= 0.2751, np.abs(Z - 1.7) <= 0.0751)
    exhaust = np.outer(np.abs(Y) <= 0.2751, np.abs(Z - 0.3) <= 0.0751)
    for dy, dz in np.ndindex(2, 2):
        velocity[:, :, 0] += 0.1 * np.roll(supply, (dy, dz), (0, 1))
        velocity[:, :, 0] -= 0.1 * np.roll(exhaust, (dy, dz), (0, 1))
    velocity[:, :, 2] = 0.25 * np.maximum(velocity[:, :, 0], 0)
    temperature[velocity[:, :, 0] > 0] = 300.0
    temperature[velocity[:, :, 0] < 0] = 296.0
    return PlaneData("x_min", Y, Z, temperature, np.zeros((61, 61)), velocity)


def test_a_plane_tells_its_openings_with_their_flow():
    given = plane()
    inlet, outlet = plane_openings(given)

    assert isinstance(inlet, Inlet)
    assert isinstance(outlet, Outlet)
    (y0, z0), (y1, z1) = inlet.patch.lower_m, inlet.patch.upper_m
    # The plane's own flow, by the trapezoidal rule.
    flow = np.maximum(given.velocity_m_s[..., 0], 0).sum() * 0.05**2
    assert inlet.velocity_m_s[0] * (y1 - y0) * (z1 - z0) == pytest.approx(flow, rel=1e-6)
    # The flow falls to half on a vertex here, so the edges are exact.
    assert (y1 - y0, z1 - z0) == pytest.approx((0.55, 0.15), abs=1e-6)
    assert inlet.velocity_m_s[0] == pytest.approx(0.4, rel=1e-6)
    assert inlet.velocity_m_s[2] / inlet.velocity_m_s[0] == pytest.approx(0.25, rel=1e-6)
    assert inlet.temperature_k == pytest.approx(300.0)
    assert outlet.mean_temperature_k == pytest.approx(296.0)


def test_openings_are_taken_from_a_plane_only_where_none_are_stated():
    camera = looking_along_y(position_m=(0.0, -8.0, 1.5), width_px=40, height_px=40, focal_px=80.0)

    def scene(*parts) -> Scene:
        return Scene(
            room=Box(lower_m=(0.0, -1.5, 0.0), upper_m=(3.0, 1.5, 3.0)),
            views=(View(camera=camera),),
            light=FixedTexture(),
            boundary=(PlaneField(file="plane.npz"), *parts),
        )

    bare = Problem(scene(), (), (plane(),))
    found = with_planes_read(bare).scene.boundary
    assert [type(part) for part in found] == [PlaneField, Inlet, Outlet, MeasuredWall]

    heater = Heater(patch=Patch(wall="z_min", lower_m=(1.0, 0.0), upper_m=(2.0, 1.0)), temperature_k=310.0)
    stated = Problem(scene(heater, *CLOSED), (), (plane(),))
    assert with_planes_read(stated) is stated


def test_a_plane_of_still_air_has_no_openings():
    still = PlaneData("x_min", Y, Z, np.full((61, 61), 295.0), np.zeros((61, 61)), np.zeros((61, 61, 3)))
    assert plane_openings(still) == []


def test_walls_are_told_from_openings_and_a_plane_without_flow_is_all_wall():
    still = still_vertices(plane())
    assert not still[[0, -1]].any()
    assert not still[:, [0, -1]].any()
    # 12 x 4 vertices of each opening carry flow.
    assert (~still[1:-1, 1:-1]).sum() == 2 * 12 * 4

    at_rest = PlaneData("x_min", Y, Z, np.full((61, 61), 295.0), np.zeros((61, 61)), np.zeros((61, 61, 3)))
    assert still_vertices(at_rest).sum() == 59 * 59


def test_a_plane_whose_openings_make_no_sense_is_left_alone():
    rng = np.random.default_rng(1)
    velocity = 0.1 * rng.normal(size=(61, 61, 3))
    noise = PlaneData("x_min", Y, Z, np.full((61, 61), 295.0), np.zeros((61, 61)), velocity)
    camera = looking_along_y(position_m=(0.0, -8.0, 1.5), width_px=40, height_px=40, focal_px=80.0)
    room = Box(lower_m=(0.0, -1.5, 0.0), upper_m=(3.0, 1.5, 3.0))
    scene = Scene(room=room, views=(View(camera=camera),), light=FixedTexture())
    found = with_planes_read(Problem(scene, (), (noise,))).scene.boundary

    assert [type(part) for part in found] == [MeasuredWall]


def shown(wall: Wall | None, warmer_above_k: float = 0.0) -> Problem:
    """A plane whose wall is 295 K at the floor, and warmer above."""
    given = plane()
    kelvin = given.temperature_k + warmer_above_k * Z / 3.0
    given = PlaneData("x_min", Y, Z, kelvin, given.pressure_m2_s2, given.velocity_m_s)
    boundary = () if wall is None else (wall,)
    room = Box(lower_m=(0.0, -1.5, 0.0), upper_m=(3.0, 1.5, 3.0))
    camera = looking_along_y(position_m=(0.0, -8.0, 1.5), width_px=40, height_px=40, focal_px=80.0)
    scene = Scene(room=room, views=(View(camera=camera),), light=FixedTexture(), boundary=boundary)
    return with_planes_read(Problem(scene, (), (given,)))


@pytest.mark.parametrize("wall", [None, Wall(wall="x_min", no_slip=False)])
def test_a_plane_tells_the_temperature_of_a_wall_that_nobody_stated_at_every_place(wall):
    problem = shown(wall, warmer_above_k=6.0)
    where = room(problem.scene, 30, "k_epsilon")
    layout, prior = where.layout, room_prior(problem, where.layout)
    plane_x = where.model(prior.mean).boundary.walls[0][0]

    assert unknown_walls(problem.scene) == [name for name in WALLS if name != "x_min"]
    assert layout.no_slip[0] == (wall is None)
    heights_m = layout.grid.centres_m(2)
    by_height_k = problem.scene.air.ambient_temperature_k + np.asarray(plane_x.wall_excess_k)
    wall_k = 295.0 + 2.0 * heights_m
    # Away from the openings; the rim has the wall's nearest value.
    np.testing.assert_allclose(by_height_k[3], wall_k, atol=0.15)
    # Above and below the openings the wall shows its own temperature, and not that of their air.
    closed = np.asarray(plane_x.conductance_m_s)[15] > 0
    np.testing.assert_allclose(by_height_k[15, closed], wall_k[closed], atol=0.3)
    assert not any(name.startswith("wall_excess_k[0]") for name in prior.names())


def test_a_plane_on_a_wall_whose_heat_is_stated_adds_nothing_to_it():
    for stated in (
        Wall(wall="x_min", thermal="adiabatic"),
        Wall(wall="x_min", thermal="temperature", temperature_k=290.0),
    ):
        assert [part for part in shown(stated).scene.boundary if isinstance(part, Wall)] == [stated]


def with_exhaust(share: float, *parts, sensors: tuple[SensorData, ...] = ()) -> Problem:
    """The plane with so much of its exhaust's flow, read."""
    given = plane()
    velocity = np.where(given.velocity_m_s < 0, share * given.velocity_m_s, given.velocity_m_s)
    given = PlaneData("x_min", Y, Z, given.temperature_k, given.pressure_m2_s2, velocity)
    room = Box(lower_m=(0.0, -1.5, 0.0), upper_m=(3.0, 1.5, 3.0))
    camera = looking_along_y(position_m=(0.0, -8.0, 1.5), width_px=40, height_px=40, focal_px=80.0)
    scene = Scene(room=room, views=(View(camera=camera),), light=FixedTexture(), boundary=parts)
    return with_planes_read(Problem(scene, (), (given,), sensors))


def test_a_plane_that_air_does_not_leave_by_as_it_enters_does_not_show_all_openings():
    whole, part = (with_exhaust(share).scene.boundary for share in (0.9, 0.5))
    assert [type(item) for item in whole] == [Inlet, Outlet, MeasuredWall]
    assert [type(item) for item in part] == [MeasuredWall]

    refuse_walls_alone(with_exhaust(0.9))
    # 0.4 m/s over 0.55 x 0.15 m enter.
    with pytest.raises(
        SettingError, match=r"119 m3/h enter by the planes and 59 m3/h leave .* State every inlet"
    ):
        refuse_walls_alone(with_exhaust(0.5))


def test_a_plane_of_walls_is_enough_where_something_else_tells_how_warm_the_air_is():
    nothing = np.full((1, 3), np.nan)
    sensor = SensorData(np.ones((1, 3)), np.array([296.0]), np.array([0.1]), nothing, np.full(1, 0.1))
    refuse_walls_alone(with_exhaust(0.0, sensors=(sensor,)))
    refuse_walls_alone(with_exhaust(0.0, Wall(wall="x_min", thermal="adiabatic")))
    refuse_walls_alone(with_exhaust(0.0, Wall(wall="z_max", thermal="temperature", temperature_k=300.0)))
    heater = Heater(patch=Patch(wall="z_min", lower_m=(1.0, 0.0), upper_m=(2.0, 1.0)), temperature_k=310.0)
    refuse_walls_alone(with_exhaust(0.0, heater))
