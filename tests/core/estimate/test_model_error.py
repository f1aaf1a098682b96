"""The model's error: k by likelihood, what the fit takes up of it, and its standard deviation by place."""

import numpy as np
import pytest

from core.estimate.diagnostics import doubtful
from core.estimate.forward_runs import Derivatives
from core.estimate.least_squares import Posterior
from core.estimate.model_error import ModelError, model_error, size_of
from core.estimate.observation import observations
from core.problem import Problem
from core.room.vertices import RoomFields
from tests.core.estimate.test_explained import VERTICES, room_of, seen

SHAPE = (24, 20, 22)


def still(velocity_m_s: np.ndarray) -> RoomFields:
    nothing = np.zeros(velocity_m_s.shape[:3])
    return RoomFields(nothing, nothing, velocity_m_s, np.zeros(1))


@pytest.mark.parametrize("true_size", [0.1, 1.0, 8.0])
def test_the_size_is_that_of_what_is_left_beyond_the_noise(true_size: float):
    draw = np.random.default_rng(3)
    noise, apart = np.full(40_000, 0.05**2), draw.normal(size=(2, 40_000))
    # Two pairs: half of both is what the model has wrong.
    left = true_size * draw.normal(size=40_000) + 0.05 * draw.normal(size=40_000)

    assert size_of(left, noise, apart, np.full(40_000, 12.0)) == pytest.approx(true_size, rel=0.02)


def test_of_rooms_that_lack_nothing_one_in_twenty_is_said_to_lack_something():
    sizes = np.exp(np.random.default_rng(6).standard_normal(2000))
    lacking = [ModelError((), np.zeros((0, 0)), np.zeros(0), float(size)).lacks for size in sizes]

    assert 0.03 < np.mean(lacking) < 0.07


def test_without_a_word_of_the_images_the_size_is_one():
    draw = np.random.default_rng(4)
    noise, alike = draw.normal(size=2400), np.full(2400, 12.0)

    assert size_of(np.zeros(0), np.zeros(0), np.zeros((1, 0)), np.zeros(0)) == 1.0
    # Two models that the images do not tell apart.
    assert size_of(noise, np.ones(len(noise)), np.full((1, len(noise)), 1e-6), alike) == pytest.approx(
        1.0, abs=0.01
    )


def test_a_model_that_explains_the_images_is_believed_more_than_one_that_does_not():
    data = observations(seen(4.0, 0.02), VERTICES)
    posterior = Posterior(np.zeros(0), np.zeros((0, 0)), np.zeros(0))
    own = room_of(4.0)
    pair = (own, replace_excess(own, room_of(5.0)))
    nothing = Derivatives(own, [], np.zeros((0, 0)))

    right, wrong = (
        model_error(data, posterior, nothing, (pair,), room_of(found_k)) for found_k in (4.0, 2.0)
    )

    # Half of 4 K is left, where either of two models that differ by 1 K is wrong by 0.7 K; these few windows move k a
    # part of the way to 2.8.
    assert np.all(right.size < 0.6)
    assert 1.8 < wrong.size[0] < 2.8
    assert wrong.left_ratio == pytest.approx(2.8, abs=0.2)
    assert not wrong.lacks
    same = model_error(data, posterior, nothing, ((own, own),), room_of(2.0))
    # Models that do not differ at all explain nothing.
    assert same.size[0] == pytest.approx(1.0)
    assert same.lacks


def replace_excess(room: RoomFields, other: RoomFields) -> RoomFields:
    return RoomFields(other.excess_k, room.pressure_m2_s2, room.velocity_m_s, room.outflow_excess_k)


def test_what_the_fit_takes_up_is_no_error():
    given = seen(4.0, 0.02)
    data = observations(Problem(given.scene, given.shifts), VERTICES)
    own = room_of(4.0)
    faster = RoomFields(
        room_of(5.0).excess_k, own.pressure_m2_s2, own.velocity_m_s + 0.3, own.outflow_excess_k
    )
    # One parameter does to the room what the other closure does.
    derivatives = Derivatives(own, [faster], np.eye(1))
    size = len(data.values()[0])
    sharp, blind = (Posterior(np.zeros(1), np.eye(1), np.full(size, std)) for std in (1e-9, 1.0))

    taken, left = (model_error(data, known, derivatives, ((own, faster),), own) for known in (sharp, blind))

    slopes = derivatives.per_deviation(lambda run: run.velocity_m_s)
    assert taken.moved[0, 0] == pytest.approx(1.0, abs=1e-3)
    assert taken.deviation("velocity_m_s", slopes).max() < 1e-3
    # Data that tell nothing move nothing: the whole difference is left.
    assert left.moved[0, 0] == pytest.approx(0.0, abs=1e-3)
    assert left.deviation("velocity_m_s", slopes).min() > 0.02


def test_intervals_hold_errors_of_the_kind_that_they_are_made_from():
    draw = np.random.default_rng(5)
    one, other, error = (0.1 * draw.normal(size=(*SHAPE, 3)) for _ in range(3))
    apart = ModelError(((still(one), still(other)),), np.zeros((1, 0)), np.ones(1), 1.0)

    std = apart.deviation("velocity_m_s", np.zeros((0, *SHAPE, 3)))

    assert np.mean(np.abs(error) < 1.96 * std) > 0.95
    # Twice the size, twice the error.
    double = ModelError(apart.pairs, apart.moved, 2.0 * apart.size, 2.0)
    np.testing.assert_allclose(double.deviation("velocity_m_s", np.zeros((0, *SHAPE, 3))), 2 * std, rtol=1e-6)


def test_over_a_room_the_error_is_expected_to_be_as_large_as_it_is():
    draw = np.random.default_rng(5)
    # Two models that are wrong each by itself, more at one end of the room than elsewhere.
    wrong = np.where(np.arange(SHAPE[0]) < 3, 0.2, 0.05)[:, None, None, None]
    one, other = (wrong * draw.normal(size=(*SHAPE, 3)) for _ in range(2))
    apart = ModelError(((still(one), still(other)),), np.zeros((1, 0)), np.ones(1), 1.0)

    expected = apart.mean_square("velocity_m_s", np.zeros((0, *SHAPE, 3)))

    assert expected == pytest.approx(np.mean(one**2), rel=0.15)


def test_parameters_move_as_far_as_either_model_is_wrong_by_its_size():
    moved = np.array([[3.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(
        ModelError((), moved, np.full(2, 0.5), 0.5).moves, [0.5 * 3 / 2**0.5, 0.5 / 2**0.5]
    )


def test_a_velocity_of_which_half_may_be_wrong_is_not_to_be_believed():
    assert doubtful(0.24) == ["The velocity is expected to be wrong by 24 % of its size (rms)."]
    assert "distrust the velocity" in " ".join(doubtful(0.51))
    assert "its whole size" in doubtful(3.2)[0]
