"""What is known becomes a checked problem, and the data term that a scene asks for gets what it compares."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadInputError
from app.experiment.captures import newest_pair, write_capture
from app.experiment.folder import ExperimentSettings, create_experiment
from app.files.durable import write_text
from app.reconstruct.measure import measure
from app.reconstruct.presets import PRESETS, STANDARD, check_data_term, sized
from app.reconstruct.problem import known_of, problem_of
from app.report.answer import checks
from calibration.bundle import given_bundle, to_json
from core.geometry import Box, looking_along_y
from core.scene import FixedTexture, Inlet, Outlet, Patch, ProjectedPattern, Scene, SolveModel, View
from core.setting import SettingError
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, image_loss
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern

ROOM = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))
SUPPLY = Patch(wall="x_min", lower_m=(-0.5, 0.0), upper_m=(0.5, 0.5))
INLET = Inlet(patch=SUPPLY, temperature_k=300.0, velocity_m_s=(0.5, 0.0, 0.0))
CAMERA = looking_along_y(position_m=(0.0, -3.0, 0.0), width_px=128, height_px=96, focal_px=200.0)
SHAPE = (9, 9, 9)


def captured(folder, data_term, *, moved_px=0, known=(INLET,)):
    """An experiment whose flow picture is the reference, its middle moved by whole pixels; the border is still."""
    solve = SolveModel(data_term=data_term, window_px=16)
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), boundary=known, solve=solve)
    experiment = create_experiment(folder, ExperimentSettings(scene=scene))
    still = pattern()
    flow = still.copy()
    flow[:, 40:88] = np.roll(still, moved_px, axis=1)[:, 40:88]
    for role, view in (("reference", still), ("flow", flow)):
        burst = run_capture(SimulatedCamera(lambda view=view: view, seed=1), CapturePlan(role=role, frames=2))
        write_capture(experiment.captures_folder / f"1-{role}", burst)
    return experiment


def compared(experiment):
    """The rows of the image loss that the problem of an experiment leads to: what each compares."""
    known = known_of(experiment)
    measured = measure(newest_pair(experiment), known.scene)
    problem = problem_of(known, measured.shifts, measured.images)
    loss = image_loss(problem, frame_of(problem), 1.0, DataModel(), SHAPE)
    return problem, [np.asarray(view.target) for view in loss.views]


def test_the_warped_term_compares_the_captured_pictures(tmp_path):
    problem, (still,) = compared(captured(tmp_path / "still", "warped"))
    assert len(problem.images) == 1
    # One row a pixel of the inner wall, which sees noise alone.
    assert len(still) > 1000
    _, (moved,) = compared(captured(tmp_path / "moved", "warped", moved_px=1))
    assert np.sqrt(np.mean(moved**2)) > 3 * np.sqrt(np.mean(still**2))
    windows, (shifts,) = compared(captured(tmp_path / "windows", "displacement"))
    assert windows.images == ()
    assert len(shifts) < 100


@pytest.mark.parametrize("preset", PRESETS)
def test_a_data_term_that_a_preset_does_not_use_is_refused_by_its_name(preset):
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture())
    for term in ("auto", "displacement"):
        check_data_term(preset, replace(scene, solve=SolveModel(data_term=term)))
    with pytest.raises(BadInputError, match=r"'rendered'.*captures have none"):
        check_data_term(preset, replace(scene, solve=SolveModel(data_term="rendered")))
    warped = replace(scene, solve=SolveModel(data_term="warped"))
    if preset == "grid":
        check_data_term(preset, warped)
    else:
        with pytest.raises(BadInputError, match=f"'warped'.*preset '{preset}'"):
            check_data_term(preset, warped)


def test_a_bundle_that_cannot_be_used_is_refused_in_one_sentence(tmp_path):
    experiment = captured(tmp_path / "one", "auto")
    experiment.bundle_path.parent.mkdir()
    experiment.bundle_path.write_text("{")
    with pytest.raises(BadInputError, match=r"bundle\.json is not JSON .* Mend .*bundle\.json"):
        known_of(experiment)
    experiment.bundle_path.write_text('{"schema_version": 1, "colour": "red"}')
    with pytest.raises(BadInputError, match=r"The calibration cannot be used: .*bundle\.json"):
        known_of(experiment)


def test_what_contradicts_itself_is_refused_where_the_problem_is_made(tmp_path):
    experiment = captured(tmp_path / "twice", "auto", known=(INLET, Outlet(patch=SUPPLY)))
    known = known_of(experiment)
    measured = measure(newest_pair(experiment), known.scene)
    with pytest.raises(SettingError, match="contradict each other"):
        problem_of(known, measured.shifts)


def test_a_stated_grid_sizes_the_room():
    scene = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture())
    assert sized(STANDARD, scene) == STANDARD
    stated = sized(STANDARD, replace(scene, solve=SolveModel(grid=12)))
    assert (stated.cells, stated.coarse_cells) == (12, 8)


def test_a_camera_whose_wall_is_not_calibrated_has_its_lens_and_stands_where_the_scene_says(tmp_path):
    projector = replace(CAMERA, position_m=(0.5, -3.0, 0.0))
    scene = Scene(
        room=ROOM,
        views=(View(camera=CAMERA),),
        light=ProjectedPattern(projector=projector),
        boundary=(INLET,),
    )
    experiment = create_experiment(tmp_path / "one", ExperimentSettings(scene=scene))
    # As the steps camera and projector leave them: in the camera's own frame.
    own = replace(CAMERA, focal_px=(210.0, 210.0), position_m=(0.0, 0.0, 0.0), rotation_rad=(0.0, 0.0, 0.0))
    lamp = replace(own, position_m=(0.4, 0.0, 0.0))

    def known(wall_m):
        date = "2026-03-01T12:00:00+00:00"
        made = given_bundle(date=date, cameras={"camera": own}, projector=lamp, back_wall_y_m=wall_m)
        write_text(experiment.bundle_path, to_json(made))
        return known_of(experiment)

    afar, placed = known(None), known(1.0)

    assert afar.scene.views[0].camera == replace(CAMERA, focal_px=own.focal_px)
    assert afar.scene.light.projector == replace(projector, focal_px=own.focal_px)
    assert checks([afar.optics]) == (afar.optics,)
    assert (placed.scene.views[0].camera, placed.scene.light.projector) == (own, lamp)
    assert checks([placed.optics]) == ()
