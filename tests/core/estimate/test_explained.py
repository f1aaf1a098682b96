"""What a room explains of the images, with the noise taken out, and what may then be said of entries."""

import re
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.diagnostics import another_closure, contradictions, misfit, other_way
from core.estimate.discrepancy import temperature_correction
from core.estimate.explained import explained, likeness
from core.estimate.least_squares import Posterior
from core.estimate.model_error import ModelError
from core.estimate.observation import IMAGES, observations
from core.known import leaving_excess_k
from core.motion import CameraMotion
from core.problem import Problem, ShiftMeasurement
from core.room.boundary_conditions import SuspectedHeater
from core.room.vertices import RoomFields
from core.scene import Patch
from tests.core.estimate.test_temperature_levels import prior_of, problem

VERTICES = (8, 8, 8)


def room_of(warmer_k: float) -> RoomFields:
    """Air that is warmer by so much at the ceiling than on the floor."""
    warm = np.broadcast_to(warmer_k * np.linspace(0.0, 1.0, VERTICES[2]) ** 2, VERTICES).copy()
    return RoomFields(warm, np.zeros(VERTICES), np.zeros((*VERTICES, 3)), np.zeros(1))


def seen(warmer_k: float, noise: float, seed: int = 0, window_px: int = 16) -> Problem:
    """Pictures of that air with `noise` times its rms shift; the scene is the tests' own."""
    given = problem(stated=True)
    camera = given.scene.views[0].camera
    across = [np.arange(window_px / 2, size_px, window_px) for size_px in (camera.width_px, camera.height_px)]
    centres = np.stack(np.meshgrid(*across), -1).reshape(-1, 2)
    clean = ShiftMeasurement(
        centres, np.zeros((len(centres), 2)), np.tile(1e8 * np.eye(2), (len(centres), 1, 1)), window_px
    )
    operator = observations(Problem(given.scene, (clean,)), VERTICES).shifts[0].operator
    refractivity = given.scene.air.excess_refractivity(jnp.asarray(room_of(warmer_k).excess_k, jnp.float32))
    shift = np.asarray(eqx.filter_jit(lambda o, e: o.apply(e))(operator, refractivity))
    std_px = noise * float(np.sqrt(np.mean(shift**2)))
    shift = shift + std_px * np.random.default_rng(seed).normal(size=shift.shape)
    information = np.tile(np.eye(2) / std_px**2, (len(centres), 1, 1))
    return Problem(given.scene, (replace(clean, displacement_px=shift, information_per_px2=information),))


def test_the_share_that_is_left_is_that_of_the_signal():
    data = observations(seen(4.0, 0.05), VERTICES)

    half = explained(data, room_of(2.0))
    assert half.share_left == pytest.approx(0.5, abs=0.03)
    # A room that has half of it lacks as much as it has.
    assert half.left_over_own == pytest.approx(1.0, abs=0.06)
    assert explained(data, room_of(4.0)).share_left < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_not_held_against_a_room(seed: int):
    data = observations(seen(4.0, 3.0, seed), VERTICES)

    values, _, _ = data.values()
    left = values - data.predicted(room_of(4.0))
    assert np.linalg.norm(left) > 0.85 * np.linalg.norm(values)
    assert explained(data, room_of(4.0)).share_left < 0.6


def test_where_all_is_noise_the_share_is_the_one_without_images():
    data = observations(seen(4.0, 300.0), VERTICES)
    nothing = explained(observations(Problem(data.scene, ()), VERTICES), room_of(4.0))

    assert nothing.share_left == pytest.approx(0.3)
    assert explained(data, room_of(4.0)).left_over_own < 1.5


def test_pictures_that_went_the_other_way_are_told_and_those_of_noise_are_not():
    right, noise = (observations(seen(4.0, n), VERTICES) for n in (0.3, 30.0))

    assert likeness(right, room_of(3.0)) > 0.8
    assert not other_way(likeness(right, room_of(3.0)))
    assert "swapped" in other_way(likeness(right, room_of(-3.0)))[0]
    assert not other_way(likeness(noise, room_of(-3.0)))
    assert likeness(observations(Problem(right.scene, ()), VERTICES), room_of(3.0)) == 0.0


def test_noise_takes_nothing_from_how_alike_pictures_and_room_are_but_makes_it_unsure():
    faint = observations(seen(4.0, 1.0, window_px=8), VERTICES)
    # As they are, noise and all, they correlate by -0.72.
    assert likeness(faint, room_of(-3.0)) < -0.8

    alarms = sum(
        bool(other_way(likeness(observations(seen(4.0, 300.0, seed, window_px=8), VERTICES), room_of(-3.0))))
        for seed in range(20)
    )
    assert alarms <= 1


@pytest.mark.parametrize(("model", "doubt", "told"), [(0.0, 0.2, True), (2.0, 0.2, False), (0.0, 0.6, False)])
def test_an_entry_is_called_wrong_only_beyond_what_entry_and_model_allow(
    model: float, doubt: float, told: bool
):
    given = problem(stated=True)
    prior = prior_of(given)
    own = prior.names().index("inlet_log_flow[0]")
    vector = np.zeros(len(prior.names()))
    vector[own] = 4.0
    found = Posterior(vector, 0.01 * np.eye(len(vector)), np.zeros(0))

    said = contradictions(given, prior, found, np.full(len(vector), model), doubt)

    assert len(said) == told
    assert all("4.0 times what the entry and the model may be wrong by" in text for text in said)


def test_of_rooms_with_right_entries_one_in_twenty_has_such_a_sentence():
    given = problem(stated=True)
    prior = prior_of(given)
    rng = np.random.default_rng(5)
    active = len(prior.names())
    alarms = 0
    for _ in range(400):
        by_model = rng.uniform(0.0, 2.0, active)
        vector = np.sqrt(1.0 + by_model**2) * rng.normal(size=active)
        found = Posterior(vector, 0.01 * np.eye(active), np.zeros(0))
        alarms += bool(contradictions(given, prior, found, by_model))
    assert 0.01 < alarms / 400 < 0.08


@pytest.mark.parametrize(
    ("noise", "ratio", "found_k", "doubted"),
    [(0.1, 8.0, 3.0, True), (0.1, 2.0, 3.0, False), (0.1, 2.0, 1.0, True), (3.0, 8.0, 1.0, False)],
)
def test_a_room_is_doubted_for_what_is_more_than_noise_and_more_than_models_differ_in(
    noise, ratio, found_k, doubted
):
    data = observations(seen(4.0, noise), VERTICES)
    error = ModelError((), np.zeros((0, 0)), np.zeros(0), ratio)

    said = " ".join(misfit(data, explained(data, room_of(found_k)), error))

    assert ("cannot explain these images" in said) == doubted
    assert ("no more than their noise" in said) == (noise > 1.0)


def after_a_step(given: Problem, std_px: float) -> Problem:
    """The same pictures, after the camera moved by as much as it may."""
    (shift,) = given.shifts
    motion = CameraMotion(given.scene.views[0].camera, std_px * np.eye(6))
    step_px = motion.at(shift.centres_px) @ np.array([1.0, -0.6, -0.9, 0.4, -0.8, 0.7])
    moved = replace(shift, displacement_px=shift.displacement_px + step_px, motion=motion)
    return replace(given, shifts=(moved,))


@pytest.mark.parametrize("std_px", [1e-6, 1e-3, 1.0])
def test_squares_without_what_windows_share_are_those_of_the_whole_covariance(std_px: float):
    data = observations(after_a_step(seen(4.0, 0.3), std_px), VERTICES)
    values, variance, kinds = data.values()
    shared = np.zeros((len(values), 6))
    shared[kinds == IMAGES] = data.shifts[0].shared_px.reshape(-1, 6)
    total = np.diag(variance) + shared @ shared.T

    rest = data.unshared(values, variance)
    both = data.unshared(np.stack([values, 2.0 * values], axis=1), variance)

    expected = float(values @ np.linalg.solve(total, values))
    assert float(np.sum(rest**2 / variance)) == pytest.approx(expected, rel=1e-3)
    np.testing.assert_allclose(both, np.stack([rest, 2.0 * rest], axis=1))


@pytest.mark.parametrize("std_px", [1e-9, 1.0, 1e3])
def test_a_camera_that_moved_by_far_more_than_the_air_did_makes_no_temperature(std_px: float):
    data, room = observations(after_a_step(seen(4.0, 0.05), std_px), VERTICES), room_of(4.0)
    values, _, kinds = data.values()
    residual = np.where(kinds == IMAGES, values - data.predicted(room), 0.0)

    found = temperature_correction(data, room.excess_k, residual, 1.0, 0.1, 0.1)

    # Of 4 K.
    assert np.abs(found.excess_k).max() < 0.05


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_panel_that_is_colder_beside_a_warm_source_is_no_source_nor_the_other_way_round(sign: float):
    given = problem(stated=True)
    panels = tuple(
        SuspectedHeater(
            patch=Patch(wall="z_min", lower_m=(x_m, 0.8), upper_m=(x_m + 0.4, 1.2)),
            temperature_k=293.15,
            temperature_std_k=20.0,
        )
        for x_m in (0.2, 0.6, 1.0)
    )
    warmed = Problem(replace(given.scene, boundary=(*given.scene.boundary, *panels)), ())
    prior = prior_of(warmed)
    of_air_k = leaving_excess_k(warmed) or 0.0
    vector = np.zeros(len(prior.names()))
    for n, above_air_k in enumerate((12.0, 53.0, -11.0)):
        vector[prior.names().index(f"heater_excess_k[{n}]")] = (sign * above_air_k + of_air_k) / 20.0
    found = Posterior(vector, 0.01 * np.eye(len(vector)), np.zeros(0))

    said = [
        text for text in contradictions(warmed, prior, found, np.zeros(len(vector))) if "floor panel" in text
    ]

    word = "warmer" if sign > 0 else "colder"
    assert [text.partition(" m, ")[2][: len("12 K warmer")] for text in said] == [
        f"12 K {word}",
        f"53 K {word}",
    ]


@pytest.mark.parametrize(
    ("left", "stated", "said"), [(0.33, 0.41, "33 %.*41 %"), (0.3041, 0.3049, "30.4 %.*30.5 %")]
)
def test_two_closures_shares_differ_in_words_too(left, stated, said):
    assert re.search(said, another_closure("large_eddies", left, "k_epsilon", stated))
