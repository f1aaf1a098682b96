"""Particle paths against flows whose paths are known in closed form."""

import numpy as np
import pytest

from core.result import Solution
from core.streamlines import particle_paths


def room(velocity, size_m=(2.0, 2.0, 1.0), cells=8):
    axes = [np.linspace(0.0, length, cells + 1, dtype=np.float32) for length in size_m]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    still = np.full(points.shape[:-1], 293.0, np.float32)
    return Solution(*axes, temperature_k=still, velocity_m_s=velocity(points).astype(np.float32))


def test_solid_rotation_brings_each_particle_back_to_its_start():
    turn_s = 10.0
    rate = 2 * np.pi / turn_s

    def velocity(points):
        x, y = points[..., 0] - 1.0, points[..., 1] - 1.0
        return np.stack([-rate * y, rate * x, np.zeros_like(x)], axis=-1)

    starts_m = np.array([[1.5, 1.0, 0.5], [1.0, 0.3, 0.2], [1.1, 1.1, 0.9]])
    paths = particle_paths(room(velocity), starts_m, turn_s, times=5)

    # The flow is linear, so interpolation is exact: what is left is the step's error and float32's 2 pi.
    np.testing.assert_allclose(paths.positions_m[:, -1], starts_m, atol=1e-5)
    # A quarter of a turn takes (0.5, 0) to (0, 0.5).
    np.testing.assert_allclose(paths.positions_m[0, 1], [1.0, 1.5, 0.5], atol=1e-5)
    assert not paths.left.any()


def test_plug_flow_stays_length_by_speed():
    starts_m = np.array([[0.0, 0.5, 0.5], [0.5, 1.0, 0.2], [1.9, 1.9, 0.9]])
    paths = particle_paths(
        room(lambda points: np.broadcast_to([0.25, 0.0, 0.0], points.shape)), starts_m, 20.0, times=21
    )

    np.testing.assert_allclose(paths.residence_s, (2.0 - starts_m[:, 0]) / 0.25, rtol=1e-6)
    assert paths.left.all()
    # Half-way at half the time; nowhere once it has left.
    np.testing.assert_allclose(paths.positions_m[0, 4], [1.0, 0.5, 0.5], atol=1e-6)
    assert np.isnan(paths.positions_m[0, 9:]).all()


def test_a_particle_that_stays_is_followed_to_the_limit():
    still = room(lambda points: np.zeros_like(points))
    paths = particle_paths(still, np.array([[1.0, 1.0, 0.5]]), 7.0, times=3)
    assert (paths.residence_s[0], paths.left[0]) == (7.0, False)


def test_without_a_velocity_it_is_said_what_to_do():
    without = Solution(*(np.linspace(0, 1, 3, dtype=np.float32),) * 3, np.full((3, 3, 3), 293.0, np.float32))
    with pytest.raises(ValueError, match="standard"):
        particle_paths(without, np.zeros((1, 3)), 1.0)
