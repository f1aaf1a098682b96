"""A drawn jet's throw and drop."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Inlet, Patch
from core.setting import SettingError
from core.ventilation.jet import supply_jet
from tests.core.ventilation.rooms import box

SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(1.2, 1.4), upper_m=(1.8, 1.6)),
    temperature_k=290.0,
    velocity_m_s=(1.0, 0.0, 0.0),
)


def jet_room(fall_m_m: float, decay_m: float):
    """Speed 1 m/s at the wall, exponentially less along x; the middle falls by so much a metre."""
    found = box(np.zeros((41, 31, 41, 3)))
    x, y, z = np.meshgrid(found.x_m, found.y_m, found.z_m, indexing="ij")
    middle = 1.5 - fall_m_m * x
    width = np.exp(-(((y - 1.5) / 0.4) ** 2) - ((z - middle) / 0.2) ** 2)
    found.velocity_m_s[..., 0] = np.exp(-x / decay_m) * width
    return found


def test_a_throw_ends_where_the_jet_is_slower_than_a_quarter():
    jet = supply_jet(jet_room(0.0, 1.5), SUPPLY)
    # exp(-x / 1.5) = 0.25; linear between planes 0.1 m apart.
    assert jet.throw_m == pytest.approx(1.5 * np.log(4.0), abs=0.01)
    assert jet.ended
    assert jet.drop_m == pytest.approx(0.0, abs=0.03)


def test_a_cold_jet_drops():
    jet = supply_jet(jet_room(0.4, 1.5), SUPPLY)
    assert jet.throw_m == pytest.approx(1.5 * np.log(4.0), abs=0.05)
    # Half a vertex of 0.05 m, and the plane before the throw's end.
    assert jet.drop_m == pytest.approx(0.4 * jet.throw_m, abs=0.07)


def test_a_jet_that_reaches_the_wall_opposite_has_no_end():
    jet = supply_jet(jet_room(0.0, 50.0), SUPPLY)
    assert not jet.ended
    assert jet.throw_m == 4.0


def test_a_slow_supply_has_no_throw():
    assert supply_jet(jet_room(0.0, 1.5), SUPPLY, terminal_m_s=2.0).throw_m == 0.0


def test_a_jet_from_the_ceiling_has_a_throw_and_no_drop():
    found = box(np.zeros((21, 21, 41, 3)))
    found.velocity_m_s[..., 2] = -np.exp(-(2.0 - found.z_m) / 0.5)
    patch = Patch(wall="z_max", lower_m=(1.5, 1.0), upper_m=(2.5, 2.0))
    jet = supply_jet(found, replace(SUPPLY, patch=patch, velocity_m_s=(0.0, 0.0, -1.0)))
    assert jet.throw_m == pytest.approx(0.5 * np.log(4.0), abs=0.01)
    assert np.isnan(jet.drop_m)


def test_a_result_without_velocity_is_refused():
    found = box(np.zeros((3, 3, 3, 3)))
    with pytest.raises(SettingError, match="standard"):
        supply_jet(type(found)(found.x_m, found.y_m, found.z_m, found.temperature_k), SUPPLY)
