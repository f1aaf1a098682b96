import numpy as np
import pytest

from core.estimate.plane_openings import plane_openings, still_vertices, with_plane_openings
from core.geometry import Box, looking_along_y
from core.problem import PlaneData, Problem
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, PlaneField, Scene, View

Y, Z = np.linspace(-1.5, 1.5, 61), np.linspace(0.0, 3.0, 61)


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
    found = with_plane_openings(bare).scene.boundary
    assert [type(part) for part in found] == [PlaneField, Inlet, Outlet]

    heater = Heater(patch=Patch(wall="z_min", lower_m=(1.0, 0.0), upper_m=(2.0, 1.0)), temperature_k=310.0)
    stated = Problem(scene(heater), (), (plane(),))
    assert with_plane_openings(stated) is stated


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
    problem = Problem(scene, (), (noise,))

    assert with_plane_openings(problem) is problem
