"""Where the camera's motion is read off: a border that is still, and one that the room's air is before."""

import re

import numpy as np
from scipy import ndimage

from app.reconstruct.drift import agreement, mount, without_known_drift
from app.reconstruct.yardstick import Exposures
from core.displacement import window_centres
from core.geometry import looking_along_y
from core.motion import motion_basis
from tests.core.test_displacement import band_limited

SHAPE, WINDOW_PX, NOISE = (224, 256), 16, 2e-3
# A lens that sees 40 degrees: turned, the corners move by a fifth more than the middle.
LENS = looking_along_y(position_m=(0.0, 0.0, 0.0), width_px=SHAPE[1], height_px=SHAPE[0], focal_px=350.0)
CREEP_PX = np.array([0.05, -0.1, 0.02, 0.05, 0.12, -0.2])
CENTRES = window_centres(SHAPE, WINDOW_PX)
SIZE_PX = (SHAPE[1], SHAPE[0])
BEYOND = np.any((CENTRES < 48) | (CENTRES > np.array(SIZE_PX) - 48), axis=1) & np.all(
    (CENTRES > 16) & (CENTRES < np.array(SIZE_PX) - 16), axis=1
)


def exposures(seed, air_px, textured=True):
    """Two noisy pictures; the second one moved by the mount, and by air whose shift is `air_px(x, y)`."""
    rng, picture = np.random.default_rng(seed), band_limited(SHAPE, seed, shortest_px=5.0)
    row, column = np.indices(SHAPE, dtype=float)
    points = np.stack([column.ravel(), row.ravel()], 1)
    moved = (motion_basis(points, LENS) @ CREEP_PX).T.reshape(2, *SHAPE)
    moved = moved + np.array(air_px(column / SHAPE[1], row / SHAPE[0]))
    after = ndimage.map_coordinates(picture, [row - moved[1], column - moved[0]], order=5, mode="nearest")
    if not textured:
        bare = ~((row > 56) & (row < SHAPE[0] - 56) & (column > 56) & (column < SHAPE[1] - 56))
        picture, after = np.where(bare, 0.5, picture), np.where(bare, 0.5, after)
    before, after = (p + NOISE * rng.standard_normal(SHAPE) for p in (picture, after))
    variance = np.full(SHAPE, 2 * NOISE**2, np.float32)
    return Exposures(before.astype(np.float32), after.astype(np.float32), variance, WINDOW_PX, LENS)


def still_air(x, y):
    inside = np.exp(-20 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    return 0.02 * inside * np.sin(20 * x), 0.02 * inside * np.cos(15 * y)


def air_everywhere(x, y):
    return 0.05 * np.sin(12 * x) * np.cos(6 * y), 0.05 * np.cos(9 * y + 4 * x)


def drift_of(pictures):
    return without_known_drift(pictures, ~BEYOND, BEYOND, mount(1.0))


def test_a_still_border_gives_the_creep():
    basis = motion_basis(CENTRES, LENS)
    for seed in range(6):
        shift, drift_px, note = drift_of(exposures(seed, still_air))
        assert "from the border" in note
        # Which of the motions it was is not told (a turn is nearly a shift); what they do to the picture is.
        np.testing.assert_allclose(basis @ drift_px, basis @ CREEP_PX, atol=6e-3)
        assert shift.motion is not None
        assert 1e-5 < np.linalg.norm(shift.motion.at(CENTRES), axis=(1, 2)).max() < 0.01


def a_little_air_everywhere(size_px):
    """Smooth, as the air of a room is: what it does to the picture is in part like a motion of the camera."""

    def air_px(x, y):
        return size_px * (0.5 + np.cos(4 * x - 2 * y)), size_px * (np.sin(3 * y) - np.cos(3 * x + 2 * y))

    return air_px


def test_what_air_the_noise_may_hide_counts_and_a_border_with_more_is_not_believed():
    basis, known_px = motion_basis(CENTRES, LENS), []
    for size_px in (0.0, 0.001, 0.002):
        off_px, said_px = [], []
        for seed in range(4):
            shift, drift_px, note = drift_of(exposures(seed, a_little_air_everywhere(size_px)))
            assert "from the border" in note
            assert shift.motion is not None
            off_px.append(basis @ (drift_px - CREEP_PX))
            said_px.append(np.linalg.norm(shift.motion.at(CENTRES), axis=2))
        assert np.mean(np.square(off_px)) < np.mean(np.square(said_px))
        known_px.append(np.sqrt(np.mean(np.square(said_px))))
    assert known_px[0] < 0.005
    assert known_px == sorted(known_px)
    _, _, note = drift_of(exposures(0, a_little_air_everywhere(0.01)))
    assert "The border of the picture is not still" in note


def test_a_border_with_much_air_before_it_leaves_the_creep_unknown():
    for seed in range(6):
        shift, drift_px, note = drift_of(exposures(seed, air_everywhere))
        assert "not still" in note
        assert not drift_px.any()
        assert shift.motion is not None
        np.testing.assert_allclose(shift.motion.root_px, np.eye(6))


def test_things_that_move_before_a_part_of_the_border_do_not_tell_its_motion():
    def moved(x, y):
        return 3.0 * (x < 0.2) * np.sin(40 * y), 3.0 * (y > 0.8) * np.cos(40 * x)

    _, drift_px, note = drift_of(exposures(1, moved))
    assert "from the border" in note
    basis = motion_basis(CENTRES, LENS)
    np.testing.assert_allclose(basis @ drift_px, basis @ CREEP_PX, atol=0.02)


def pushed(x, y):
    """A thing before one corner of the border that somebody pushed."""
    return 0.5 * ((x < 0.2) & (y < 0.2)), 0.0 * y


def test_a_thing_that_was_pushed_before_a_part_of_a_still_border_does_not_count():
    basis = motion_basis(CENTRES, LENS)
    for seed in range(3):
        _, drift_px, note = drift_of(exposures(seed, pushed))
        assert re.search(r"\d % of the border moves unlike the rest", note)
        np.testing.assert_allclose(basis @ drift_px, basis @ CREEP_PX, atol=6e-3)
    # Where a fifth of it moves otherwise nobody knows which part is still.
    _, drift_px, note = drift_of(exposures(0, lambda x, y: (0.5 * (x < 0.2), 0.0 * y)))
    assert "The border of the picture is not still" in note
    assert not drift_px.any()
    # Between two references the whole wall has to be still.
    assert not agreement(exposures(0, pushed), BEYOND).agree


def test_a_bare_border_says_nothing_and_the_creep_stays_in_the_shifts():
    shift, _, note = drift_of(exposures(1, still_air, textured=False))
    assert "No part of the picture" in note
    inner = np.all(np.abs(CENTRES - np.array(SIZE_PX) / 2) < 40, axis=1)
    expected = motion_basis(CENTRES[inner], LENS) @ CREEP_PX
    np.testing.assert_allclose(shift.displacement_px[inner].mean(0), expected.mean(0), atol=0.02)


def test_a_corner_of_the_border_is_still_but_tells_too_little():
    corner = BEYOND & np.all(CENTRES < 48, axis=1)
    shift, drift_px, note = without_known_drift(exposures(1, still_air), ~BEYOND, corner, mount(1.0))
    assert f"The {corner.sum()} windows beyond the wall that show something tell too little" in note
    assert not drift_px.any()
    assert shift.motion is not None
    np.testing.assert_allclose(shift.motion.root_px, np.eye(6))


def test_a_camera_that_is_stated_to_stand_still_is_believed_where_nothing_says_otherwise():
    shift, _, note = without_known_drift(exposures(2, still_air), ~BEYOND, BEYOND & False, mount(0.0))
    assert "stand still" in note
    assert shift.motion is None


def test_references_that_differ_by_more_than_a_motion_of_the_camera_are_told():
    for seed in range(3):
        still = agreement(exposures(seed, lambda x, y: (0.0 * x, 0.0 * y)), ~BEYOND)
        assert still.agree
        basis = motion_basis(CENTRES, LENS)
        np.testing.assert_allclose(basis @ still.drift_px, basis @ CREEP_PX, atol=6e-3)
        stirred = agreement(exposures(seed, air_everywhere), ~BEYOND)
        assert not stirred.agree
        assert "air was not still" in stirred.said


def test_a_motion_between_two_references_is_known_best_close_to_one_of_them():
    found = agreement(exposures(1, lambda x, y: (0.0 * x, 0.0 * y)), ~BEYOND)
    middle, late = found.at(0.5), found.at(0.9)
    assert late.std_px < 0.7 * middle.std_px
    np.testing.assert_allclose(late.mean_px, 1.8 * middle.mean_px)
