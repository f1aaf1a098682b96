"""The age of the air against closed forms: a plug, a mixed room, and what leaves in any flow."""

import numpy as np
import pytest

from core.setting import SettingError
from core.ventilation.air_change import air_change, leaving_mean, source_effectiveness, zone_share
from core.ventilation.face_flow import corner_mean, face_flow
from core.ventilation.tracer import eddy_diffusivity_m2_s, tracer
from tests.core.ventilation.rooms import (
    INLET,
    OUTLET,
    TRUE_FLOW_M3_S,
    TRUE_PATCHES,
    packaged,
    plug,
    ventilated,
)


def of(flow, diffusivity_m2_s: float):
    return tracer(flow, np.full(flow.cells, diffusivity_m2_s))


@pytest.mark.parametrize("cells", [10, 40])
def test_plug_flow_has_efficiency_one(cells):
    change = air_change(of(face_flow(plug(cells)), 0.0))
    # An upwind cell has the age of the air that leaves it, so the plug's mean age is half a cell too old.
    assert change.efficiency == pytest.approx(cells / (cells + 1), rel=1e-7)


def test_the_age_in_a_plug_grows_with_the_way():
    flow = face_flow(plug(40))
    ages = air_change(of(flow, 0.0)).age_s[:, 3, 3]
    np.testing.assert_allclose(ages, flow.axes_m[0][1:] / 0.1, rtol=1e-7)


def test_a_mixed_room_has_efficiency_one_half():
    change = air_change(of(face_flow(ventilated(), (INLET, OUTLET)), 1e3))
    # At 1000 m2/s a difference of age lasts some ten milliseconds, against 200 s of age.
    assert change.efficiency == pytest.approx(0.5, rel=1e-3)
    assert change.index() == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("diffusivity_m2_s", [0.0, 1e-3, 1.0])
def test_the_air_that_leaves_has_the_age_v_over_q(diffusivity_m2_s):
    change = air_change(of(face_flow(ventilated(), (INLET, OUTLET)), diffusivity_m2_s))
    assert change.leaving_age_s == pytest.approx(change.nominal_s, rel=1e-6)
    assert change.nominal_s == pytest.approx(24.0 / change.flow.entering_m3_s, rel=1e-12)


@pytest.fixture(scope="module", params=[12, 24])
def true_room(request):
    found = packaged()
    large = face_flow(found, TRUE_PATCHES, request.param)
    speed_m_s = corner_mean(np.linalg.norm(found.velocity_m_s, axis=-1).astype(float))
    # Its mean speed, everywhere: the same diffusivity on both grids.
    return tracer(large, eddy_diffusivity_m2_s(np.full(large.cells, float(speed_m_s.mean())), large.axes_m))


def test_in_the_packaged_room_the_age_at_the_outlet_is_volume_over_the_stated_flow(true_room):
    change = air_change(true_room)
    volume_m3 = 4.1 * 3.0 * 3.0
    assert change.leaving_age_s == pytest.approx(volume_m3 / TRUE_FLOW_M3_S, rel=0.02)


def test_in_the_packaged_room_the_efficiency_does_not_depend_on_the_cells(true_room):
    # Warm air enters above and leaves below: near to a plug from the ceiling.
    assert air_change(true_room).efficiency == pytest.approx(0.68, abs=0.02)


def test_a_source_in_a_plug_leaves_with_all_the_air_behind_it():
    transport = of(face_flow(plug(40)), 0.0)
    # From the cell at x = 1 to 1.1 m on, 30 of 40 cells hold what leaves.
    assert source_effectiveness(transport, (1.05, 1.0, 1.0)) == pytest.approx(40 / 30, rel=1e-6)


def test_a_source_in_a_mixed_room_leaves_as_it_is_anywhere():
    transport = of(face_flow(ventilated(), (INLET, OUTLET)), 1e3)
    assert source_effectiveness(transport, (2.0, 1.5, 1.0)) == pytest.approx(1.0, rel=1e-2)


def test_a_source_outside_the_room_is_refused():
    with pytest.raises(SettingError, match=r"y = 3\.5 m"):
        source_effectiveness(of(face_flow(plug(8)), 0.0), (1.0, 3.5, 1.0))


def test_all_of_a_source_leaves():
    flow = face_flow(ventilated(), (INLET, OUTLET))
    source = np.random.default_rng(1).random(flow.cells)
    found = of(flow, 1e-3).concentration(source)
    assert leaving_mean(flow, found) * flow.entering_m3_s == pytest.approx(source.sum(), rel=1e-6)


def test_a_zone_counts_parts_of_cells():
    flow = face_flow(plug(8))
    share = zone_share(flow, (0.25, 0.0, 0.0), (1.0, 3.0, 1.0))
    np.testing.assert_allclose(share[:, 0, 0], [0.5, 1.0, 0, 0, 0, 0, 0, 0])
    # In a plug of 40 s the first metre is younger than the mean.
    assert air_change(of(flow, 0.0)).index(share) > 2.0


def test_eddies_grow_with_speed_and_distance_from_the_wall():
    axes = tuple(np.linspace(0.0, 2.0, 5) for _ in range(3))
    found = eddy_diffusivity_m2_s(np.full((4, 4, 4), 0.5), axes)
    # 0.03874 x 0.5 m/s x 0.75 m / 0.85, and the air's own.
    assert found[1, 1, 1] == pytest.approx(0.03874 * 0.5 * 0.75 / 0.85 + 2.1e-5)
    assert found[0, 1, 1] == pytest.approx(0.03874 * 0.5 * 0.25 / 0.85 + 2.1e-5)
