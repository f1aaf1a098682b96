"""A sequence is measured as the mean of its bursts, with the error that so short a mean has."""

import numpy as np
import pytest

from app.capture.burst import Order, take, take_order
from app.errors import BadInputError
from app.experiment.captures import newest_pair
from app.experiment.folder import ExperimentSettings, create_experiment, open_experiment
from app.experiment.shift_files import read_shifts, write_shifts
from app.reconstruct.measure import measure
from core.motion import without_motion
from core.scene import FixedTexture, Scene, SolveModel, View
from core.watch import StoppedError, Watch
from drivers.burst import CapturePlan
from drivers.shift import shift_image
from drivers.simulated import SensorNoise, SimulatedCamera
from tests.app.reconstruct.test_problem import CAMERA, ROOM
from tests.drivers.scenes import pattern

# Of each burst, in px to the right in one band of the picture and to the left in the next, as no camera moves. A
# burst is a minute apart from the next.
MOVES_PX = (0.05, -0.03, 0.04, 0.0, -0.06, 0.02)
PLAN = CapturePlan(role="flow", frames=4, settle_frames=0)


def signs(rows, count):
    """Of each row: the band that it is in goes to the right (1) or to the left (-1)."""
    return np.where((rows * 4 // count) % 2 == 0, 1, -1)


def in_bands(still, move_px):
    rows = signs(np.arange(still.shape[0]), still.shape[0])[:, None]
    right, left = (shift_image(still, (way * move_px, 0.0)) for way in (1, -1))
    return np.where(rows > 0, right, left)


def measured(folder, bursts, moves_px=MOVES_PX, watch=Watch(), seen=lambda number, picture: picture):
    """`seen` is what the camera sees of the picture of a burst."""
    scene = Scene(
        room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), solve=SolveModel(window_px=8)
    )
    experiment = create_experiment(folder, ExperimentSettings(scene=scene))
    still = pattern()
    moved = [seen(number, in_bands(still, move_px)) for number, move_px in enumerate(moves_px)]

    def camera():
        return SimulatedCamera(
            lambda: still,
            seed=1,
            moving=lambda time_s: moved[min(int((time_s + 1.0) // 60.0), len(moved) - 1)],
            noise=SensorNoise(1e8, 0.0, 64.0, 16),
        )

    with SimulatedCamera(lambda: still, seed=2) as reference:
        take(reference, experiment, CapturePlan(role="reference", frames=8))
    with camera() as moving:
        taken = take_order(moving, experiment, Order(PLAN, bursts, 60.0 if bursts > 1 else 0.0))
    assert len(taken) == bursts
    return newest_pair(experiment), measure(newest_pair(experiment), scene, watch)


def test_a_sequence_is_the_mean_of_its_bursts_and_knows_its_error(tmp_path):
    captures, whole = measured(tmp_path / "sequence", len(MOVES_PX))
    (shift,) = whole.shifts
    assert captures.flow.images[0].frames == len(MOVES_PX) * PLAN.frames
    # The camera's time went on between the bursts: each saw the air of its minute.
    to_the_right = shift.displacement_px[:, 0] * signs(shift.centres_px[:, 1].astype(int), CAMERA.height_px)
    assert np.median(to_the_right) == pytest.approx(np.mean(MOVES_PX), abs=0.004)
    error_px = np.sqrt((shift.short_mean_px[:, 0] ** 2).sum(axis=-1)).mean()
    expected_px = np.std(MOVES_PX, ddof=1) / len(MOVES_PX) ** 0.5
    assert 0.5 * expected_px < error_px < 2.0 * expected_px
    assert "mean of 6 bursts over 360 s" in whole.notes[0]
    assert "For half of it, take 1440 s" in whole.notes[0]
    assert {"flow/0/flow.tif", "flow/5/manifest.json"} <= set(captures.inputs)


def test_a_motion_as_large_as_the_error_weighs_no_more_than_that(tmp_path):
    _, whole = measured(tmp_path / "sequence", len(MOVES_PX))
    (shift,) = whole.shifts
    still = without_motion(shift.common_errors_px, shift.information_per_px2)
    moved = np.zeros_like(shift.displacement_px)
    moved[:, 0] = np.std(MOVES_PX, ddof=1) / len(MOVES_PX) ** 0.5
    before, after = (
        np.einsum("wa,wab,wb->", one, shift.information_per_px2, one) for one in (moved, still.apply(moved))
    )
    assert before > 1e3
    assert after < 10.0


def test_one_burst_is_measured_as_it_is_and_two_say_that_they_are_too_few(tmp_path):
    captures, one = measured(tmp_path / "one", 1)
    assert one.shifts[0].short_mean_px is None
    assert captures.bursts == ()
    assert "mean of" not in one.notes[0]
    _, two = measured(tmp_path / "two", 2)
    assert two.shifts[0].short_mean_px is None
    assert "too few" in two.notes[0]


def test_air_that_stands_still_has_a_mean_without_such_an_error(tmp_path):
    _, still = measured(tmp_path / "still", 6, moves_px=(0.02,) * 6)
    (shift,) = still.shifts
    assert shift.short_mean_px is None or np.abs(shift.short_mean_px).max() < 1e-3
    assert "mean of 6 bursts" in still.notes[0]


def test_a_result_keeps_the_error_of_its_mean(tmp_path):
    _, whole = measured(tmp_path / "sequence", len(MOVES_PX))
    write_shifts(tmp_path, whole.shifts)
    (kept,) = read_shifts(tmp_path)
    np.testing.assert_array_equal(kept.short_mean_px, whole.shifts[0].short_mean_px)


def test_a_stop_between_the_bursts_keeps_those_that_are_measured(tmp_path):
    class Kept(dict):
        kept = 0

        def __setitem__(self, name, content):
            self.kept += 1
            super().__setitem__(name, content)

    store, told = Kept(), []
    stopping = Watch(lambda row, growing: told.append(row["doing"]), lambda: len(told) >= 4, store)
    with pytest.raises(StoppedError):
        measured(tmp_path / "sequence", len(MOVES_PX), watch=stopping)
    assert told[-1] == "measure burst 4 of 6"
    assert store.kept == 4
    experiment = open_experiment(tmp_path / "sequence")
    pair, scene = newest_pair(experiment), experiment.settings.scene
    gone_on = measure(pair, scene, Watch(store=store))
    assert store.kept == len(MOVES_PX)
    afresh = measure(pair, scene)
    for ours, theirs in zip(gone_on.bursts, afresh.bursts, strict=True):
        np.testing.assert_array_equal(ours[0].displacement_px, theirs[0].displacement_px)
        np.testing.assert_array_equal(ours[0].motion.root_px, theirs[0].motion.root_px)
    np.testing.assert_array_equal(gone_on.shifts[0].short_mean_px, afresh.shifts[0].short_mean_px)


def test_who_walks_by_in_one_burst_is_left_out_of_all(tmp_path):
    quarter = CAMERA.width_px // 4

    def walked_by(number, picture):
        if number == 2:
            picture = picture.copy()
            # A thin veil: too little in the mean of all to be refused there.
            veil = np.random.default_rng(0).uniform(-0.03, 0.03, picture[:, :quarter].shape)
            picture[:, :quarter] += veil.astype(np.float32)
        return picture

    _, whole = measured(tmp_path / "sequence", len(MOVES_PX), seen=walked_by)
    (shift,) = whole.shifts
    assert shift.centres_px[:, 0].min() > quarter - 8
    assert "in one of the bursts" in whole.notes[0]
    error_px = np.sqrt((shift.short_mean_px[:, 0] ** 2).sum(axis=-1)).mean()
    assert error_px < 2.0 * np.std(MOVES_PX, ddof=1) / len(MOVES_PX) ** 0.5


def test_a_burst_without_light_or_wall_is_named(tmp_path):
    with pytest.raises(BadInputError, match=r"flow picture has \d+ % of the light"):
        measured(
            tmp_path / "dark",
            6,
            seen=lambda number, picture: picture * np.float32(0.02 if number == 2 else 1.0),
        )

    def covered(number, picture):
        noise = np.random.default_rng(0).uniform(0.2, 0.8, picture.shape)
        return noise.astype(np.float32) if number == 2 else picture

    with pytest.raises(BadInputError, match=r"something else than the pattern.*without this burst"):
        measured(tmp_path / "covered", 6, seen=covered)
