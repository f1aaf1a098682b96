import numpy as np

from app.benches.placement import share_left
from core.geometry import Box

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 3.0))


def test_a_horizontal_baseline_is_blind_to_stratification_and_nothing_is_left_at_none():
    height = np.linspace(0.0, 1.0, 24)
    layered = np.broadcast_to(5.0 * height**2, (24, 24, 24)).copy()

    none, across, up = (share_left(ROOM, layered, 4.0, b) for b in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))

    # Camera and projector in one place see nothing; across, only the slant of the rays differs.
    assert none < 1e-4
    assert across < 0.15
    assert up > 0.2
