"""What passes the faces of cells is conserved to the last digit, whatever was found."""

import numpy as np
import pytest

from core.geometry import face_of
from core.setting import SettingError
from core.ventilation.face_flow import face_flow
from tests.core.ventilation.rooms import INLET, OUTLET, TRUE_FLOW_M3_S, TRUE_PATCHES, box, packaged, plug
from tests.core.ventilation.rooms import ventilated as room


def left_over(flow) -> float:
    """Greatest flow that a cell gets and does not pass on, over all that enters."""
    found = sum(np.diff(q, axis=a) for a, q in enumerate(flow.flow_m3_s))
    return float(np.abs(found).max()) / flow.entering_m3_s


@pytest.fixture(scope="module")
def flow():
    return face_flow(room(), (INLET, OUTLET))


def test_every_cell_passes_on_what_it_gets(flow):
    # Rounding of the cosine basis.
    assert left_over(flow) < 1e-12


def test_what_enters_is_what_the_inlets_vertices_say(flow):
    # 0.2 m/s through the trapezia around the vertices within the patch.
    found = room()
    inside = np.sum(found.velocity_m_s[0, ..., 0])
    # The vertices on the ceiling stand for half a cell.
    inside -= 0.5 * np.sum(found.velocity_m_s[0, :, -1, 0])
    area_m2 = (found.y_m[1] - found.y_m[0]) * (found.z_m[1] - found.z_m[0])
    assert flow.entering_m3_s == pytest.approx(inside * area_m2, rel=1e-12)


def test_as_much_leaves_as_enters_and_by_the_outlet(flow):
    leaving = -flow.inward(face_of("x_max"))
    assert leaving.sum() == pytest.approx(flow.entering_m3_s, rel=1e-12)


def test_nothing_passes_a_wall_beside_the_openings(flow):
    for wall in ("y_min", "y_max", "z_min", "z_max"):
        assert not flow.inward(face_of(wall)).any()


def test_a_flow_without_divergence_is_taken_as_it_is():
    flow = face_flow(plug(8))
    np.testing.assert_allclose(flow.flow_m3_s[0], 0.1 * 3.0 * 2.0 / 36, rtol=1e-12)
    assert np.abs(flow.flow_m3_s[1]).max() < 1e-15


@pytest.mark.parametrize("cells", [3, 5, 8, 100])
def test_larger_cells_pass_the_same(flow, cells):
    large = face_flow(room(), (INLET, OUTLET), cells)
    assert large.cells == (min(cells, 12),) * 3
    assert left_over(large) < 1e-12
    assert large.entering_m3_s == pytest.approx(flow.entering_m3_s, rel=1e-12)


def test_the_packaged_rooms_flow_is_the_stated_one():
    flow = face_flow(packaged(), TRUE_PATCHES)
    assert left_over(flow) < 1e-12
    # The room is kept on vertices between which an opening's edge falls.
    assert flow.entering_m3_s == pytest.approx(TRUE_FLOW_M3_S, rel=0.02)


def test_a_room_that_nothing_enters_is_refused():
    with pytest.raises(SettingError, match="State the room's inlets"):
        face_flow(box(np.zeros((5, 5, 5, 3))))


def test_a_result_without_velocity_is_refused():
    found = room()
    with pytest.raises(SettingError, match="standard"):
        face_flow(type(found)(found.x_m, found.y_m, found.z_m, found.temperature_k))
