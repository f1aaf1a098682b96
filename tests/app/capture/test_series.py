"""Reference, flow, reference: the second reference tells what the mount did, and whether the air was still."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import app.simulate
from app.capture.burst import take
from app.capture.series import take_series
from app.errors import BadInputError
from app.experiment.captures import Capture, newest_pair
from app.experiment.folder import Experiment, open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.reconstruct.measure import _share, between_references, measure
from app.reconstruct.problem import known_of
from app.rig.open import air_of, open_camera
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions
from drivers.burst import CapturePlan

ROOM = Path(app.simulate.__file__).parent / "sample" / "room.npz"
DRIFT_PX = 0.1


@pytest.fixture(scope="module")
def experiment(tmp_path_factory) -> Experiment:
    """A rig whose mount walks, before a wall with nothing still beside it."""
    folder = tmp_path_factory.mktemp("rig") / "e"
    camera = SimulatedCameraSettings(seed=4, drift_px=DRIFT_PX, border="bare")
    simulate(ROOM, folder, RigOptions(camera_px=(320, 240), frames=50), "operator", camera)
    return open_experiment(folder)


def test_a_flow_between_two_references_knows_the_mount_better(experiment):
    scene = known_of(experiment).scene
    alone = measure(newest_pair(experiment), scene).shifts[0]
    assert alone.motion is not None
    assert alone.motion.root_px[0, 0] == scene.views[0].drift_std_px
    with pytest.raises(BadInputError, match="capture series"):
        between_references(newest_pair(experiment), scene)

    found = take_series(
        lambda role, place: open_camera(experiment, air_of(role), moment=place),
        experiment,
        CapturePlan(frames=50),
    )
    assert found.agree
    assert "the camera moved:" in found.said
    captures = newest_pair(experiment)
    assert set(captures.names) == {"reference", "flow", "after"}
    assert captures.reference.folder == found.taken[0].folder
    measured = measure(captures, scene)
    between, moved = measured.shifts[0], between_references(captures, scene)
    assert "two references" in measured.notes[0]
    assert between.motion is not None
    # At most half of the way between the references: in the middle of the time between them.
    walked_px = moved.typical_px
    assert 0.2 * walked_px < between.motion.root_px[0, 0] <= 0.5 * walked_px
    assert between.motion.root_px[0, 0] < DRIFT_PX
    left = np.linalg.norm(between.displacement_px.mean(0))
    assert left < 4 * between.motion.root_px[0, 0]


def test_a_newer_reference_ends_the_series(experiment):
    with open_camera(experiment, "still") as camera:
        taken = take(camera, experiment, CapturePlan(frames=2))
    captures = newest_pair(experiment)
    assert captures.after is None
    assert captures.reference.folder == taken.folder


def test_the_flow_lies_where_its_clock_says_between_the_references(experiment):
    one = newest_pair(experiment).reference

    def at(began_s: float) -> Capture:
        return replace(one, manifest={**one.manifest, "origin": {"series": {"began_s": began_s}}})

    assert _share(at(100.0), at(125.0), at(200.0)) == pytest.approx(0.25)
    assert _share(at(100.0), at(100.0), at(100.0)) == 0.5
