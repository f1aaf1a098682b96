"""Further cameras by answers: made, read back, changed and removed, and each slip told at its field."""

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.errors import BadInputError
from app.experiment.folder import open_experiment, save_settings
from app.files.toml import to_toml, toml_data
from app.setup.experiment import ANSWERS_FILE, answers_of, change_answers, new_experiment, template
from app.setup.mistakes import mistakes_in
from core.geometry import WALLS
from core.scene import FixedTexture, ProjectedPattern
from core.view_frame import facing

RIGHT = {
    "name": "right",
    "wall": "x_max",
    "kind": "v4l2",
    "device": "/dev/video2",
    "width_px": 1280,
    "height_px": 960,
    "distance": "3.5 m",
    "angle_of_view": "50 deg",
    "pattern_seed": 1,
}
THROWN = {"position": ["1 m", "1 m", "2 m"], "width_px": 1920, "height_px": 1200, "angle_of_view": "40 deg"}


def jet(*views: dict[str, Any]) -> dict[str, Any]:
    return toml_data(template("wall-jet"), "answers") | {"view": [copy.deepcopy(one) for one in views]}


def made(folder, *views):
    return new_experiment(folder / "lab", to_toml(jet(*views)), "answers")


@pytest.mark.parametrize("wall", WALLS)
def test_a_camera_looks_straight_at_the_middle_of_its_wall_from_its_distance(wall, tmp_path):
    scene = made(tmp_path, RIGHT | {"wall": wall}).settings.scene
    framed, number = facing(scene, 1)
    eye, room = framed.views[number].camera, framed.room
    assert eye.position_m == pytest.approx(
        (room.centre_m[0], room.upper_m[1] - 3.5, room.centre_m[2]), abs=1e-12
    )
    np.testing.assert_allclose(eye.rotation @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    # The cameras of y_max see the first one's print; another wall has its own.
    assert (scene.views[1].light is None) == (wall == "y_max")


def test_a_view_has_its_own_device_print_and_place(tmp_path):
    experiment = made(tmp_path, RIGHT)
    scene, rig = experiment.settings.scene, experiment.settings.rig
    view = scene.views[1]
    assert (view.name, view.wall, view.camera.width_px) == ("right", "x_max", 1280)
    assert view.camera.position_m[0] == pytest.approx(0.5)  # 3.5 m before a wall at 4 m
    assert isinstance(view.light, FixedTexture)
    assert view.light.pattern.seed == 1
    assert rig.addresses == ("/dev/video0", "/dev/video2")


def test_a_projector_before_a_view_is_in_the_room_where_it_was_measured(tmp_path):
    view = made(tmp_path, RIGHT | {"projector": THROWN}).settings.scene.views[1]
    assert isinstance(view.light, ProjectedPattern)
    assert view.light.projector.position_m == pytest.approx((1.0, 1.0, 2.0))
    # It looks along x, at its wall.
    np.testing.assert_allclose(view.light.projector.rotation @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)


def test_a_scene_of_several_cameras_reads_back_to_itself_and_what_is_changed_changes_alone(tmp_path):
    experiment = made(tmp_path, RIGHT, RIGHT | {"name": "top", "wall": "z_max", "device": "/dev/video4"})
    (experiment.folder / ANSWERS_FILE).unlink()
    scene = experiment.settings.scene
    sharp = replace(scene.views[1], f_number=8.0)
    scene = replace(scene, views=(scene.views[0], sharp, scene.views[2]))
    save_settings(experiment.folder, experiment.settings.model_copy(update={"scene": scene}))
    experiment = open_experiment(experiment.folder)

    told = answers_of(experiment)
    assert [one["name"] for one in told.answers["view"]] == ["right", "top"]
    assert told.unsaid == ()
    assert mistakes_in(told.answers) == []
    assert change_answers(experiment, told.answers).settings == experiment.settings

    other = copy.deepcopy(told.answers)
    other["view"][0] |= {"name": "east", "device": "/dev/video9"}
    changed = change_answers(experiment, other).settings
    east = changed.scene.views[1]
    assert east == replace(sharp, name="east")
    assert changed.scene.views[2] == scene.views[2]
    assert changed.rig.addresses == ("/dev/video0", "/dev/video9", "/dev/video4")
    assert list(changed.rig.cameras or {}) == ["east", "top"]


def test_a_view_is_added_and_removed_again(tmp_path):
    experiment = made(tmp_path)
    before = experiment.settings
    two = change_answers(experiment, jet(RIGHT)).settings
    assert [view.name for view in two.scene.views] == ["camera", "right"]
    assert two.scene.views[0] == before.scene.views[0]
    one = change_answers(open_experiment(experiment.folder), jet()).settings
    assert (one.scene, one.rig) == (before.scene, before.rig)


@pytest.mark.parametrize(
    ("views", "field", "sentence"),
    [
        ([RIGHT | {"name": "camera"}], ("view", 0, "name"), "another camera is called 'camera'"),
        ([RIGHT, RIGHT | {"device": "/dev/video4"}], ("view", 1, "name"), "called 'right'"),
        ([RIGHT | {"device": "/dev/video0"}], ("view", 0, "device"), "the device of 'camera'"),
        ([RIGHT | {"kind": "simulated"}], ("view", 0, "kind"), "expected v4l2 or aravis"),
        ([RIGHT | {"wall": "y_max", "projector": THROWN}], ("view", 0, "projector"), "pattern of 'camera'"),
        (
            [
                RIGHT | {"projector": THROWN | {"url": "pjlink://10.0.0.2"}},
                RIGHT
                | {"name": "top", "wall": "z_max", "device": "/dev/video4"}
                | {"projector": THROWN | {"url": "pjlink://10.0.0.2"}},
            ],
            ("view", 1, "projector", "url"),
            "its own address",
        ),
        (
            [RIGHT | {"projector": THROWN | {"position": ["5 m", "1 m", "2 m"]}}],
            ("view", 0, "projector", "position", 0),
            "x is 5 m, at or behind the wall x_max at x = 4 m.*smaller x",
        ),
        (
            [
                {k: v for k, v in RIGHT.items() if k != "distance"}
                | {"wall": "z_min", "position": ["1 m", "1 m", "0 m"]}
            ],
            ("view", 0, "position", 2),
            "larger z",
        ),
        ([RIGHT | {"wall": "left"}], ("view", 0, "wall"), "x_min"),
        ([RIGHT | {"distance": "3.5"}], ("view", 0, "distance"), "has no unit"),
        ([RIGHT | {"position": ["1 m", "1 m", "1 m"]}], ("view", 0), "give distance"),
    ],
)
def test_a_slip_is_told_at_its_field(views, field, sentence, tmp_path):
    (wrong,) = mistakes_in(jet(*views))
    assert wrong.path == field
    with pytest.raises(BadInputError, match=f"(?s){sentence}"):
        made(tmp_path, *views)


def test_cameras_of_a_simulated_rig_are_all_simulated(tmp_path):
    sample = toml_data(template("sample"), "sample")
    eye = {k: v for k, v in sample["camera"].items() if k != "truth"}
    view = eye | {"name": "right", "wall": "x_max", "pattern_seed": 1}
    experiment = new_experiment(tmp_path / "lab", to_toml(sample | {"view": [view]}), "answers")
    assert experiment.settings.rig.cameras is None
    (wrong,) = mistakes_in(sample | {"view": [RIGHT]})
    assert wrong.path == ("view", 0, "kind")
    (experiment.folder / ANSWERS_FILE).unlink()
    told = answers_of(experiment).answers
    assert told["view"][0]["kind"] == "simulated"
    assert mistakes_in(told) == []
