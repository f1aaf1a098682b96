import numpy as np

from app.bench.placement import share_left
from app.volume.scene import RIG_PLACES
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


def test_the_lab_rig_keeps_the_signal_where_the_papers_place_is_nearly_blind():
    x, height = np.linspace(-1.0, 1.0, 24)[:, None, None], np.linspace(0.0, 1.0, 24)
    layers = 5.0 * height**2
    plume = 5.0 * np.exp(-((x / 0.3) ** 2)) * np.ones((24, 24, 24))

    for excess_k in (np.broadcast_to(layers, (24, 24, 24)).copy(), plume):
        paper, lab = (share_left(ROOM, excess_k, *RIG_PLACES[name]) for name in ("paper", "lab"))
        assert lab > 0.3
        assert lab > 3 * paper
