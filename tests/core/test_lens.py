"""A lens's distortion and its way back."""

import numpy as np
import pytest

from core.lens import directions, has_direction

MATRIX = np.array([[900.0, 0.0, 639.5], [0.0, 900.0, 511.5], [0.0, 0.0, 1.0]])


def distorted(plane, k1, k2, k3):
    r2 = np.sum(plane**2, axis=1, keepdims=True)
    return 900.0 * plane * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) + [639.5, 511.5]


@pytest.mark.parametrize("k", [(0.0, 0.0, 0.0), (-0.3, 0.1, 0.0), (0.2, 0.0, 0.0), (-0.35, 0.153, -0.048)])
def test_what_a_lens_shows_has_a_direction_up_to_where_it_turns_back(k):
    k1, k2, k3 = k
    radius = np.linspace(0.0, 2.0, 2001)
    grows = np.diff(radius * (1 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6)) > 0
    turns_back = radius[-1] if grows.all() else radius[np.argmin(grows)]
    plane = np.linspace(0.0, 0.99, 50)[:, None] * min(turns_back, 0.95) * np.array([0.8, 0.6])
    distortion = np.array([k1, k2, 0.0, 0.0, k3])

    shown = distorted(plane, *k)

    assert has_direction(MATRIX, distortion, shown).all()
    np.testing.assert_allclose(directions(MATRIX, distortion, shown)[:, :2], plane, atol=1e-6)
    if turns_back < radius[-1]:
        furthest = distorted(turns_back * np.array([[0.8, 0.6]]), *k)
        beyond = furthest + np.array([[0.8, 0.6]]) * np.array([[2.0], [20.0], [200.0]])
        assert not has_direction(MATRIX, distortion, beyond).any()
