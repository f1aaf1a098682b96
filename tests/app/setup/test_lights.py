"""Further projectors by answers: made, read back, changed and removed, and each slip told at its field."""

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.capture.burst import take
from app.errors import BadInputError
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, open_experiment, save_settings
from app.files.toml import to_toml, toml_data
from app.rig.open import open_camera, open_projector
from app.setup.experiment import ANSWERS_FILE, answers_of, change_answers, new_experiment, template
from app.setup.mistakes import mistakes_in
from core.scene import ProjectedPattern, View, WaveletPattern
from drivers.burst import CapturePlan
from tests.app.capture.test_turns import simulated
from tests.app.setup.test_views import RIGHT, THROWN

FIRST = {"position": ["1 m", "-1 m", "1.3 m"], "width_px": 1920, "height_px": 1200, "angle_of_view": "40 deg"}
LEFT = {
    "name": "from the left",
    "camera_of": "camera",
    "position": ["3 m", "-1 m", "2 m"],
    "width_px": 1024,
    "height_px": 768,
    "angle_of_view": "45 deg",
    "pattern_seed": 5,
    "url": "pjlink://10.0.0.2",
}
ASIDE = RIGHT | {"projector": THROWN | {"url": "pjlink://10.0.0.3"}}
ABOVE = LEFT | {
    "name": "from above",
    "camera_of": "right",
    "position": ["1 m", "1 m", "2.5 m"],
    "url": "pjlink://10.0.0.4",
}


def jet(**lists: Any) -> dict[str, Any]:
    answers = toml_data(template("wall-jet"), "answers") | {"projector": FIRST | {"url": "pjlink://10.0.0.1"}}
    return {name: copy.deepcopy(value) for name, value in (answers | lists).items() if value}


def made(folder, **lists: Any) -> Experiment:
    return new_experiment(folder / "lab", to_toml(jet(**lists)), "answers")


def shown(view: View) -> ProjectedPattern:
    assert isinstance(view.light, ProjectedPattern)
    return view.light


def test_a_further_projector_is_a_view_of_its_own_that_its_cameras_view_is_but_for_the_light(tmp_path):
    experiment = made(tmp_path, view=[ASIDE], light=[LEFT, ABOVE])
    camera, right, left, above = experiment.settings.scene.views
    for view, owner in ((left, camera), (above, right)):
        assert view == replace(owner, name=view.name, camera_of=owner.name, light=view.light)
    projector = shown(left).projector
    assert projector.position_m == (3.0, -1.0, 2.0)
    assert (projector.width_px, projector.height_px) == (1024, 768)
    assert projector.focal_px[0] == pytest.approx(512 / np.tan(np.radians(22.5)))
    pattern = shown(left).pattern
    assert isinstance(pattern, WaveletPattern)
    assert pattern.seed == 5
    # The one before the right wall looks at it, along x.
    np.testing.assert_allclose(shown(above).projector.rotation @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    rig = experiment.settings.rig
    assert {name: one.url for name, one in (rig.projectors or {}).items()} == {
        "right": "pjlink://10.0.0.3",
        "from the left": "pjlink://10.0.0.2",
        "from above": "pjlink://10.0.0.4",
    }
    # Each of them can be spoken to by the number of its view.
    for number in range(4):
        open_projector(experiment, number).close()


def test_a_scene_with_further_projectors_reads_back_to_itself(tmp_path):
    experiment = made(tmp_path, view=[ASIDE], light=[LEFT, ABOVE])
    (experiment.folder / ANSWERS_FILE).unlink()
    told = answers_of(experiment)
    assert told.unsaid == ()
    assert mistakes_in(told.answers) == []
    assert [(one["name"], one["camera_of"], one["url"]) for one in told.answers["light"]] == [
        (one["name"], one["camera_of"], one["url"]) for one in (LEFT, ABOVE)
    ]
    assert change_answers(experiment, told.answers).settings == experiment.settings


def test_a_simulated_rig_with_a_further_projector_is_edited_and_keeps_it(tmp_path):
    folder = simulated(tmp_path / "room", "--views", "y,x", "--further-projector", "-1,-1")
    experiment = open_experiment(folder)
    scene = experiment.settings.scene
    # Somebody put the further projector before the second camera, and takes more frames under it.
    first, aside, second = scene.views
    scene = replace(
        scene, views=(replace(first, name="north"), replace(second, camera_of="north", frames=7), aside)
    )
    experiment = save_settings(folder, experiment.settings.model_copy(update={"scene": scene}))
    told = answers_of(experiment)
    assert mistakes_in(told.answers) == []
    assert told.answers["light"][0]["camera_of"] == "camera"
    assert change_answers(experiment, told.answers).settings.scene.views == scene.views

    other = copy.deepcopy(told.answers)
    other["light"][0] |= {"name": "low", "position": ["1 m", "-1 m", "0.3 m"]}
    other["camera"]["frames"] = 9
    north, low, right = change_answers(experiment, other).settings.scene.views
    assert (north.name, right) == ("north", aside)
    assert (low.name, low.camera_of, low.camera) == ("low", "north", second.camera)
    # A change of the camera's is taken over; what was otherwise here before is answered by nobody.
    assert (north.frames, low.frames) == (9, 9)
    moved_m = np.subtract(shown(low).projector.position_m, scene.room.lower_m)
    np.testing.assert_allclose(moved_m, (1.0, -1.0, 0.3), atol=1e-9)
    # The lens of the simulated projector is shifted, which no answer says.
    assert shown(low).projector.principal_px == shown(second).projector.principal_px


def test_a_camera_takes_its_projectors_along_and_a_new_one_has_what_no_answer_says_of_its_camera(tmp_path):
    experiment = made(tmp_path, view=[ASIDE], light=[ABOVE])
    scene = experiment.settings.scene
    camera, right, above = scene.views
    views = (
        replace(camera, f_number=8.0),
        replace(right, f_number=4.0),
        replace(above, f_number=4.0, frames=9),
    )
    experiment = save_settings(
        experiment.folder,
        experiment.settings.model_copy(update={"scene": replace(scene, views=views)}),
    )
    # Its camera is moved, has another name, and the projector stays before it.
    east = ASIDE | {"name": "east", "distance": "3.2 m"}
    _, right, above = change_answers(
        experiment, jet(view=[east], light=[ABOVE | {"camera_of": "east"}])
    ).settings.scene.views
    assert (right.name, above.camera_of) == ("east", "east")
    assert right.camera.position_m[0] == above.camera.position_m[0] == pytest.approx(0.8)
    assert (above.f_number, above.frames) == (4.0, 9)
    # Before the first camera it is that camera's view.
    experiment = open_experiment(experiment.folder)
    camera, right, above, left = change_answers(
        experiment, jet(view=[east], light=[ABOVE | {"camera_of": "camera"}, LEFT])
    ).settings.scene.views
    assert (above.camera, above.wall, above.f_number) == (camera.camera, "y_max", 8.0)
    assert (left.camera, left.f_number, left.camera_of) == (camera.camera, 8.0, "camera")
    rig = open_experiment(experiment.folder).settings.rig
    assert list(rig.projectors or {}) == ["east", "from above", "from the left"]
    # Without them it is as before.
    experiment = open_experiment(experiment.folder)
    changed = change_answers(experiment, jet(view=[east])).settings
    assert changed.scene.views == (camera, right)
    assert list(changed.rig.projectors or {}) == ["east"]


WITHOUT = {"projector": None}


@pytest.mark.parametrize(
    ("lists", "field", "sentence"),
    [
        ({"light": [LEFT | {"camera_of": "left"}]}, ("light", 0, "camera_of"), "no camera 'left'.*'camera'"),
        (
            {"light": [LEFT, LEFT | {"name": "more", "url": "", "camera_of": LEFT["name"]}]},
            ("light", 1, "camera_of"),
            "no camera 'from the left'",
        ),
        ({"light": [LEFT | {"name": "camera"}]}, ("light", 0, "name"), "another camera is called 'camera'"),
        ({"light": [LEFT, LEFT | {"url": ""}]}, ("light", 1, "name"), "another projector is called"),
        ({"light": [LEFT], "view": [ASIDE | {"name": "from the left"}]}, ("light", 0, "name"), "camera is called"),
        (WITHOUT | {"light": [LEFT]}, ("light", 0, "camera_of"), "a print hangs on y_max.*cannot be switched off"),
        ({"light": [ABOVE], "view": [RIGHT]}, ("light", 0, "camera_of"), "a print hangs on x_max.*'right'"),
        (
            {"light": [LEFT | {"position": ["3 m", "3 m", "2 m"]}]},
            ("light", 0, "position", 1),
            "y is 3 m, at or behind the wall y_max.*smaller y",
        ),
        ({"light": [LEFT, LEFT | {"name": "more"}]}, ("light", 1, "url"), "at pjlink://10.0.0.2.*its own address"),
        ({"light": [LEFT | {"url": "pjlink://10.0.0.1"}]}, ("light", 0, "url"), "its own address"),
        ({"light": [LEFT | {"angle_of_view": "45"}]}, ("light", 0, "angle_of_view"), "has no unit"),
        # What is wrong with the projector or the camera itself is told once.
        (
            {"light": [LEFT], "projector": FIRST | {"width_px": 2}},
            ("projector", "width_px"),
            "16",
        ),
        ({"light": [ABOVE], "view": [ASIDE | {"distance": "3 kg"}]}, ("view", 0, "distance"), "no unit of length"),
    ],
)  # fmt: skip
def test_a_slip_is_told_at_its_field(lists, field, sentence, tmp_path):
    (wrong,) = mistakes_in(jet(**lists))
    assert wrong.path == field
    with pytest.raises(BadInputError, match=f"(?s){sentence}"):
        made(tmp_path, **lists)


def test_a_second_camera_of_a_wall_has_projectors_in_turn_as_the_first_has(tmp_path):
    second = RIGHT | {"name": "second", "wall": "y_max"}
    views = made(tmp_path, view=[second], light=[LEFT | {"camera_of": "second"}]).settings.scene.views
    assert (views[2].camera, views[2].camera_of) == (views[1].camera, "second")


def test_the_packaged_room_is_taken_under_both_projectors(tmp_path):
    sample = toml_data(template("sample"), "sample")
    sample["camera"] |= {"width_px": 96, "height_px": 72, "frames": 2}
    answers = sample | {"projector": FIRST, "light": [LEFT | {"url": ""}]}
    experiment = new_experiment(tmp_path / "lab", to_toml(answers), "answers")
    with open_camera(experiment, "still") as camera:
        taken = take(camera, experiment, CapturePlan(frames=2))
    assert taken.folder is not None
    # What both light, away from the edges of either.
    one, other = (image.mean[24:48, 32:64].ravel() for image in load_capture(taken.folder).images)
    assert min(one.std(), other.std()) > 0.01
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.5
