import numpy as np
import pytest

from drivers.quick_look import quick_look, tile_shift
from drivers.shift import shift_image
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern


def frame_of(view, seed):
    frame = SimulatedCamera(lambda: view, seed=seed).grab()
    return (frame.pixels / frame.full_scale_counts).astype(np.float32)


@pytest.mark.parametrize("shift", [(0.1, -0.3), (1.5, 0.7), (-2.5, 2.0)])
def test_drift_of_the_whole_picture_is_measured(shift):
    view = pattern(512, 640)
    look = quick_look(frame_of(view, 1), frame_of(shift_image(view, shift), 2))
    # 40-odd border tiles of 64 px at a noise of 0.02 px each.
    assert look.drift_px == pytest.approx(shift, abs=0.01)
    assert look.largest_px < 0.1


def test_a_plume_inside_is_told_from_the_drift():
    view = pattern(512, 640)
    moved = shift_image(view, (0.2, 0.1))
    plume = shift_image(view, (0.2, 0.7))
    moved[192:320, 256:384] = plume[192:320, 256:384]
    look = quick_look(view, moved)
    assert look.drift_px == pytest.approx((0.2, 0.1), abs=0.01)
    assert look.largest_px == pytest.approx(0.6, abs=0.1)


def test_a_brighter_picture_is_not_a_moved_one_and_a_blank_one_has_no_shift():
    view = pattern(96, 96)
    assert tile_shift(view, 1.2 * view + 0.05) == pytest.approx((0, 0), abs=1e-3)
    assert tile_shift(np.full((64, 64), 0.5, np.float32), np.full((64, 64), 0.5, np.float32)) is None
