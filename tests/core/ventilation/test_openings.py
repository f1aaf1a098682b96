"""Air and heat through the openings, by hand."""

import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.scene import FixedTexture, Inlet, Outlet, Scene, View
from core.ventilation.face_flow import face_flow
from core.ventilation.openings import exchange, opening_patches
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
