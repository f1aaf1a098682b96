"""The ensemble: what is drawn, what is regressed on it, and what measurements make of it."""

from dataclasses import replace

import numpy as np
import pytest

from core.drift import motion_hides
from core.estimate.ensemble import drawn, ensemble_fit, redrawn
from core.estimate.forward_runs import Derivatives
from core.estimate.least_squares import Posterior
from core.estimate.marches import Marches
from core.estimate.observation import observations
from core.estimate.parameter_step import misfit_ratio
from core.motion import CameraMotion
from core.room.vertices import RoomFields
from core.solve.room import background_of, solve_room
from core.watch import Watch
from tests.core.solve.test_room import (
    SETTINGS,
    SUPPLY,
    deviations,
    measured,
    scene,
    telling,
    true_room,
)


@pytest.mark.parametrize("active", [1, 4, 9])
def test_members_have_the_priors_mean_and_covariance(active: int):
    vectors = drawn(active)
    assert len(vectors) == 2 * (active + 1)
    np.testing.assert_allclose(vectors.mean(0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cov(vectors.T).reshape(active, active), np.eye(active), atol=1e-12)
    np.testing.assert_array_equal(vectors, drawn(active))


def test_members_are_moved_and_stretched_to_what_was_found():
    root = np.array([[0.5, 0.0, 0.0], [0.3, 0.2, 0.0], [-0.1, 0.1, 0.4]])
    found = Posterior(np.array([1.0, -2.0, 0.5]), root @ root.T, np.zeros(0))

    moved = redrawn(redrawn(drawn(3), Posterior(np.ones(3), 0.3 * np.eye(3), np.zeros(0))), found)

    np.testing.assert_allclose(moved.mean(0), found.vector, atol=1e-12)
    np.testing.assert_allclose(np.cov(moved.T), found.covariance, atol=1e-12)


def test_slopes_over_the_members_are_those_of_a_linear_room():
    vectors = drawn(3) * 0.2 + np.array([1.0, 0.0, -1.0])
    slopes = np.random.default_rng(1).normal(size=(3, 4, 4, 4))

    def fields(vector: np.ndarray) -> RoomFields:
        warm = 2.0 + np.tensordot(vector, slopes, axes=1)
        return RoomFields(warm, warm, np.repeat(warm[..., None], 3, -1), np.zeros(1))

    members = [fields(vector) for vector in vectors]
    mean = fields(vectors.mean(0))
    found = Derivatives(mean, members, vectors - vectors.mean(0)).per_deviation(lambda room: room.excess_k)

    np.testing.assert_allclose(found, slopes, atol=1e-9)


def test_a_wrong_supply_is_found_though_the_camera_moved_by_more_than_the_air_moved_the_picture():
    wrong = replace(SUPPLY, temperature_k=305.15)
    problem = measured(scene(wrong), true_room(scene(SUPPLY)), 1e-5)
    (shift,) = problem.shifts
    motion = CameraMotion((200, 200), 5.0 * np.eye(4))
    step_px = motion.at(shift.centres_px) @ np.array([0.4, -1.0, 0.7, 0.2])
    shift = replace(shift, displacement_px=shift.displacement_px + step_px, motion=motion)
    assert motion_hides(shift)
    assert not motion_hides(problem.shifts[0])
    problem = replace(problem, shifts=(shift,))
    background = background_of(problem, SETTINGS, Marches())
    data = observations(problem, (SETTINGS.vertices,) * 3)
    told: list[dict] = []

    found = ensemble_fit(background, data, SETTINGS, telling(told))

    warmer = background.prior.names().index("inlet_excess_k[0]")
    excess_k = float(np.asarray(background.prior.parameters(found.posterior.vector).inlet_excess_k[0]))
    # Entered 12 K; it has 10 K.
    assert excess_k == pytest.approx(10.0, abs=0.8)
    assert found.posterior.covariance[warmer, warmer] < 1.0
    assert misfit_ratio(data, found.room, background.first) < 0.7
    rounds = [row for row in told if "round" in row]
    assert SETTINGS.growing_rounds <= len(rounds) <= SETTINGS.ensemble_rounds
    # The room that is kept is one that was marched.
    kept = [deviations(background.prior, row) for row in rounds]
    assert min(np.abs(vector - found.posterior.vector).max() for vector in kept) < 1e-6
    # The solver takes this road by itself.
    solved: list[dict] = []
    solve_room(problem, SETTINGS, Watch(lambda row, growing: solved.append(dict(row))))
    assert [row for row in solved if row["doing"] == told[0]["doing"]]
