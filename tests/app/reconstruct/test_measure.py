"""What the pictures say of the shift: windows that something covers are left out, and told."""

from dataclasses import replace

import numpy as np

from app.experiment.captures import newest_pair, write_capture
from app.experiment.folder import ExperimentSettings, create_experiment
from app.reconstruct.drift import mount
from app.reconstruct.measure import _exposures, measure
from app.reconstruct.yardstick import read_motion
from core.motion import motion_basis
from core.scene import FixedTexture, Scene, SolveModel, View
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.app.reconstruct.test_problem import CAMERA, ROOM
from tests.drivers.scenes import pattern

SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), solve=SolveModel(window_px=8))


def measured(folder, covered):
    """A still pair of pictures of the pattern; in the flow, `covered` rows and columns show something plain."""
    flow = pattern().copy()
    flow[covered] = 0.3
    return measure(captured(folder, pattern(), flow), SCENE)


def captured(folder, still, flow):
    experiment = create_experiment(folder, ExperimentSettings(scene=SCENE))
    for role, view in (("reference", still), ("flow", flow)):
        burst = run_capture(SimulatedCamera(lambda view=view: view, seed=1), CapturePlan(role=role, frames=8))
        write_capture(experiment.captures_folder / f"1-{role}", burst)
    return newest_pair(experiment)


def test_windows_that_a_person_covers_are_left_out_and_told(tmp_path):
    clear = measured(tmp_path / "clear", np.s_[:0, :0])
    person = measured(tmp_path / "person", np.s_[32:64, 56:80])

    assert "left out" not in clear.notes[0]
    assert "something else than the pattern" in person.notes[0]
    centres = {tuple(c) for c in clear.shifts[0].centres_px}
    gone = np.array(sorted(centres - {tuple(c) for c in person.shifts[0].centres_px}))
    # All windows below the person, and at most those that their gradients' filter reaches besides.
    assert {(c, r) for c, r in centres if 56 < c < 80 and 32 < r < 64} <= {tuple(g) for g in gone}
    assert np.all((gone > [44, 20]) & (gone < [92, 76]))


def unknown_px(exposures, windows):
    """How far the middle of the picture may have moved (one deviation) after these windows were asked."""
    read = read_motion(exposures, windows, mount(1.0))
    assert read is not None
    middle = (np.array([[exposures.optics.width_px, exposures.optics.height_px]]) - 1.0) / 2.0
    return np.linalg.norm(motion_basis(middle, exposures.optics)[0] @ read.root_px)


def test_hot_pixels_on_a_bare_wall_do_not_tell_that_the_camera_stood_still(tmp_path):
    bare = np.full(pattern().shape, 0.2, np.float32)
    bare[4::11, 6::13] = 1.0
    pair = captured(tmp_path / "bare", bare, bare)

    exposures = _exposures(SCENE, 0, pair.reference, pair.flow)

    # As the sensor saw it, the pixels that are always full stand still to a thousandth of a pixel.
    seen = [one.images[0].mean for one in (pair.reference, pair.flow)]
    raw = replace(exposures, before=seen[0], after=seen[1])
    everywhere = np.ones(len(exposures.as_they_are.measured(follow=False).centres_px), bool)
    assert unknown_px(raw, everywhere) < 0.003
    assert unknown_px(exposures, everywhere) > 0.02
