"""Air and heat through the openings, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.scene import FixedTexture, Inlet, Outlet, Scene, View
from core.ventilation.face_flow import face_flow
from core.ventilation.openings import AirExchange, exchange, opening_patches, outlet_weights
from tests.core.ventilation.rooms import INLET, OUTLET, box, plug, ventilated

VIEW = View(camera=looking_along_y(position_m=(2.0, -5.0, 1.0), width_px=64, height_px=48, focal_px=100.0))
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.0))


def scene(*boundary) -> Scene:
    return Scene(room=ROOM, views=(VIEW,), light=FixedTexture(), boundary=boundary)


def test_the_heat_of_a_plug_is_its_flow_times_its_difference():
    found = plug(8)
    # Air leaves as warm as it is before the outlet.
    along_k = np.interp(np.arange(9), (0, 7), (299.0, 295.0))
    temperature_k = np.broadcast_to(along_k[:, None, None], (9, 7, 7))
    air = exchange(face_flow(found), temperature_k, scene())
    # 0.1 m/s through 6 m2; dry air of 20 C and 101325 Pa has 1.2041 kg/m3.
    assert air.flow_m3_s == pytest.approx(0.6)
    assert (air.supply_k, air.exhaust_k) == pytest.approx((299.0, 295.0))
    assert air.heat_w == pytest.approx(1.2041 * 1006 * 0.6 * 4.0, rel=1e-4)
    assert [p.name for p in air.passages] == ["inlet on x_min", "outlet on x_max"]


def test_stated_openings_are_named_and_balance():
    found = ventilated()
    stated = scene(
        Inlet(patch=INLET, temperature_k=290.0, velocity_m_s=(0.2, 0.0, 0.0)), Outlet(patch=OUTLET)
    )
    flow = face_flow(found, opening_patches(stated))
    supply, exhaust = exchange(flow, found.temperature_k, stated).passages
    assert (supply.name, exhaust.name) == ("inlet on x_min", "outlet on x_max")
    assert supply.inward_m3_s == pytest.approx(-exhaust.inward_m3_s)


def test_supply_air_is_read_where_the_wall_does_not_smear_it():
    found = ventilated()
    moving = found.velocity_m_s[0, ..., 0] > 0
    temperature_k = np.full((13, 13, 13), 300.0)
    temperature_k[0] = np.where(moving, 290.0, 300.0)
    warm = box(found.velocity_m_s, temperature_k)
    stated = scene(
        Inlet(patch=INLET, temperature_k=290.0, velocity_m_s=(0.2, 0.0, 0.0)), Outlet(patch=OUTLET)
    )
    air = exchange(face_flow(warm, opening_patches(stated)), temperature_k, stated)
    assert air.supply_k == pytest.approx(290.0, abs=1e-9)


def test_leaving_air_is_not_as_cold_as_the_wall_around_its_outlet():
    found = ventilated()
    cold = np.full((13, 13, 13), 295.0)
    # Also at the outlet's edge, which a wall's vertices share.
    cold[0], cold[-1] = 290.0, 280.0
    stated = scene(
        Inlet(patch=INLET, temperature_k=290.0, velocity_m_s=(0.2, 0.0, 0.0)), Outlet(patch=OUTLET)
    )
    air = exchange(face_flow(box(found.velocity_m_s, cold), opening_patches(stated)), cold, stated)
    assert (air.supply_k, air.exhaust_k) == pytest.approx((290.0, 295.0))


def test_outlets_of_unstated_flow_share_it_by_area_in_the_mean_and_in_any_way():
    wide = Outlet(patch=replace(OUTLET, lower_m=(1.0, 0.0), upper_m=(2.5, 0.5)))
    narrow = Outlet(patch=replace(OUTLET, lower_m=(1.0, 1.0), upper_m=(1.5, 1.5)))
    rng = np.random.default_rng(0)

    def drawn(*outlets: Outlet) -> np.ndarray:
        return np.array([outlet_weights(scene(*outlets), rng) for _ in range(4000)])

    shares = drawn(wide, narrow) * np.array([0.75, 0.25])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    # Of a Dirichlet distribution of 1.5 and 0.5: mean 0.75, variance 0.75 x 0.25 / 3.
    assert shares[:, 0].mean() == pytest.approx(0.75, abs=0.02)
    assert shares[:, 0].std() == pytest.approx(0.25, rel=0.05)
    # What one of them leaves is the other's.
    np.testing.assert_array_equal(drawn(replace(wide, flow_m3_s=0.1), narrow), 1.0)
    np.testing.assert_array_equal(drawn(wide), 1.0)


def test_weights_of_outlets_move_the_exhaust_and_the_heat():
    found = plug(8)
    higher_k = 290.0 + 2.0 * np.broadcast_to(found.z_m, found.temperature_k.shape)
    supply = Inlet(
        patch=replace(INLET, upper_m=(2.0, 1.9)), temperature_k=290.0, velocity_m_s=(0.1, 0.0, 0.0)
    )
    low, high = (Outlet(patch=replace(OUTLET, lower_m=(0.5, z), upper_m=(2.5, z + 0.4))) for z in (0.0, 1.6))

    def leaving(weights: np.ndarray | None, *outlets: Outlet) -> AirExchange:
        stated = scene(supply, *outlets)
        return exchange(face_flow(found, opening_patches(stated)), higher_k, stated, weights)

    both, below, above = leaving(None, low, high), leaving(None, low), leaving(None, high)
    assert both.exhaust_k == pytest.approx(0.5 * (below.exhaust_k + above.exhaust_k))
    assert above.exhaust_k > below.exhaust_k + 2.0
    moved = leaving(np.array([1.5, 0.5]), low, high)
    assert moved.exhaust_k == pytest.approx(0.75 * below.exhaust_k + 0.25 * above.exhaust_k)
    share = (moved.supply_k - moved.exhaust_k) / (both.supply_k - both.exhaust_k)
    assert moved.heat_w == pytest.approx(share * both.heat_w)
