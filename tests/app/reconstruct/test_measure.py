"""What the pictures say of the shift: windows that something covers are left out, and told."""

import numpy as np

from app.experiment.captures import newest_pair, write_capture
from app.experiment.folder import ExperimentSettings, create_experiment
from app.reconstruct.measure import measure
from core.scene import FixedTexture, Scene, SolveModel, View
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.app.reconstruct.test_problem import CAMERA, ROOM
from tests.drivers.scenes import pattern


def measured(folder, covered):
    """A still pair of pictures of the pattern; in the flow, `covered` rows and columns show something plain."""
    scene = Scene(
        room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), solve=SolveModel(window_px=8)
    )
    experiment = create_experiment(folder, ExperimentSettings(scene=scene))
    still = pattern()
    flow = still.copy()
    flow[covered] = 0.3
    for role, view in (("reference", still), ("flow", flow)):
        burst = run_capture(SimulatedCamera(lambda view=view: view, seed=1), CapturePlan(role=role, frames=8))
        write_capture(experiment.captures_folder / f"1-{role}", burst)
    return measure(newest_pair(experiment), scene)


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
