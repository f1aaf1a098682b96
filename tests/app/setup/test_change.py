"""A scene that a file described is edited as answers, and what no answer says stays as it is."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import BadInputError
from app.experiment.folder import Experiment, create_experiment, open_experiment, save_settings
from app.files.durable import write_text
from app.setup.experiment import (
    ANSWERS_FILE,
    TEMPLATES,
    answers_of,
    change_answers,
    new_experiment,
    template,
)
from app.setup.mistakes import mistakes_in
from app.setup.readback import scene_back
from app.simulate.rehearsal import Rehearsal, rehearse
from core.objects import RoomObject
from core.scene import Inlet, PlaneField, PointSensors, Wall

DESK = RoomObject(name="my desk", lower_m=(0.5, 1.0, 0.0), upper_m=(1.5, 1.6, 0.75))


@pytest.fixture
def by_hand(tmp_path: Path) -> Experiment:
    """A scene that somebody wrote: an oblique supply, a grid, a turned camera, a wall without friction."""
    made = new_experiment(tmp_path / "lab", template("wall-jet"), "answers")
    scene = made.settings.scene
    (inlet,) = (one for one in scene.boundary if isinstance(one, Inlet))
    oblique = replace(inlet, velocity_m_s=(0.4, 0.3, 0.0), turbulence_intensity=0.2)
    boundary = [oblique if one is inlet else one for one in scene.boundary]
    boundary = [one for one in boundary if not (isinstance(one, Wall) and one.wall == "z_min")]
    boundary = [
        replace(one, no_slip=False) if isinstance(one, Wall) and one.wall == "y_min" else one
        for one in boundary
    ]
    camera = scene.views[0].camera
    views = (replace(scene.views[0], camera=replace(camera, rotation_rad=(1.5, 0.01, 0.0)), f_number=8.0),)
    other = replace(
        scene,
        views=views,
        boundary=tuple(boundary),
        objects=(DESK, replace(DESK, name="other", lower_m=(2.5, 1.0, 0.0), upper_m=(3.0, 1.6, 0.75))),
        solve=replace(scene.solve, grid=24),
    )
    save_settings(made.folder, made.settings.model_copy(update={"scene": other}))
    (made.folder / ANSWERS_FILE).unlink()
    return open_experiment(made.folder)


@pytest.mark.parametrize("name", TEMPLATES)
def test_what_was_entered_is_given_back_as_it_was_written_and_reads_back_to_the_same_scene(name, tmp_path):
    made = new_experiment(tmp_path / "lab", template(name), name)
    entered = answers_of(made)
    text = (made.folder / ANSWERS_FILE).read_text()
    assert text == template(name)
    assert entered.answers["camera"].get("distance") in text

    (made.folder / ANSWERS_FILE).unlink()
    read = answers_of(made)
    again = new_experiment(tmp_path / "again", template(name), name)
    change_answers(again, read.answers | {"camera": {**read.answers["camera"], "truth": _truth(entered)}} if
                   _truth(entered) else read.answers)  # fmt: skip
    assert entered.unsaid == read.unsaid == ()
    assert scene_back(open_experiment(again.folder).settings).answers == scene_back(made.settings).answers


def test_flows_of_outlets_are_read_back(tmp_path):
    other = (
        '[[outlet]]\nwall = "z_max"\nlower = ["1 m", "1 m"]\nupper = ["1.4 m", "1.4 m"]\nflow = "50 m3/h"\n'
    )
    made = new_experiment(tmp_path / "lab", template("wall-jet") + other, "answers")
    (made.folder / ANSWERS_FILE).unlink()

    read = answers_of(made).answers["outlet"]

    assert [item.get("flow") for item in read] == [None, "50 m3/h"]


def _truth(told) -> str:
    return told.answers["camera"].get("truth", "")


def test_a_scene_of_a_simulated_rig_is_edited_and_keeps_its_plane(tmp_path):
    made = rehearse(tmp_path, Rehearsal(camera_px=64, world="ideal"))
    told = answers_of(made)
    assert mistakes_in(told.answers) == []
    assert told.unsaid == ("boundary/plane_x_min.npz: temperature and velocity known on the plane x_min.",)
    supply = {**told.answers["supply"][0], "temperature": "29 C"}

    changed = change_answers(made, told.answers | {"supply": [supply]})

    before, after = made.settings, changed.settings
    assert after.rig == before.rig
    assert (after.information, after.title) == (before.information, before.title)
    assert any(isinstance(one, PlaneField) for one in after.scene.boundary)
    (warm,) = (one for one in after.scene.boundary if isinstance(one, Inlet))
    assert warm.temperature_k == pytest.approx(302.15)
    assert replace(after.scene, boundary=before.scene.boundary) == before.scene
    # Given back again, the scene is what it was.
    assert change_answers(changed, told.answers).settings.scene == replace(
        before.scene, boundary=_sorted_like(before, open_experiment(made.folder).settings)
    )


def _sorted_like(before, after) -> tuple:
    assert sorted(map(repr, before.scene.boundary)) == sorted(map(repr, after.scene.boundary))
    return after.scene.boundary


def test_what_no_answer_says_is_told_and_stays(by_hand: Experiment):
    told = answers_of(by_hand)
    assert mistakes_in(told.answers) == []
    sentences = " ".join(told.unsaid)
    assert len(told.unsaid) == 3
    for words in ("camera is turned", "Supply 1 blows at an angle", "does not stick to the wall y_min"):
        assert words in sentences
    supply = {**told.answers["supply"][0], "speed": "0.5 m/s"}
    camera = {**told.answers["camera"], "position": ["2 m", "-2 m", "1.35 m"]}

    after = change_answers(by_hand, told.answers | {"supply": [supply], "camera": camera}).settings.scene

    (inlet,) = (one for one in after.boundary if isinstance(one, Inlet))
    assert inlet.velocity_m_s == pytest.approx((0.5, 0.3, 0.0))
    assert inlet.turbulence_intensity == 0.2
    (view,) = after.views
    assert (view.camera.rotation_rad, view.f_number) == ((1.5, 0.01, 0.0), 8.0)
    assert view.camera.position_m == pytest.approx((2.0, -2.0, 1.35))
    walls = {one.wall: one for one in after.boundary if isinstance(one, Wall)}
    assert not walls["y_min"].no_slip
    assert "z_min" not in walls
    assert after.solve.grid == 24


def test_objects_keep_their_names_and_a_new_one_gets_a_free_name(by_hand: Experiment):
    told = answers_of(by_hand)
    first, second = told.answers["object"]
    larger = {**first, "size": ["1 m", "0.5 m", "0.75 m"]}
    extra = {"kind": "box", "position": ["2 m", "2.5 m", "0 m"], "size": ["0.4 m", "0.4 m", "1 m"]}

    objects = change_answers(
        by_hand, told.answers | {"object": [second, larger, extra]}
    ).settings.scene.objects

    assert [one.name for one in objects] == ["other", "my desk", "box 1"]
    assert objects[0].lower_m == pytest.approx((2.5, 1.0, 0.0))
    assert objects[1].size_m == pytest.approx((1.0, 0.5, 0.75))
    assert answers_of(open_experiment(by_hand.folder)).answers["object"] == [second, larger, extra]


def test_answers_that_experiment_toml_no_longer_agrees_with_are_read_anew(tmp_path):
    made = new_experiment(tmp_path / "lab", template("wall-jet"), "answers")
    settings = made.settings
    warmer = replace(settings.scene, air=replace(settings.scene.air, ambient_temperature_k=295.15))
    save_settings(made.folder, settings.model_copy(update={"scene": warmer}))

    assert answers_of(open_experiment(made.folder)).answers["air"] == "22 C"


def test_thermometers_of_a_file_are_listed_and_a_long_table_is_left_alone(tmp_path):
    made = new_experiment(tmp_path / "lab", template("wall-jet"), "answers")
    rows = [f"{0.01 * n + 0.1:g},1,1,293.15,,," for n in range(120)]
    write_text(made.folder / "boundary" / "long.csv", "\n".join(["x,y,z,T,u,v,w", *rows, ""]))
    scene = made.settings.scene
    longer = replace(scene, boundary=(*scene.boundary, PointSensors(file="boundary/long.csv")))
    both = save_settings(made.folder, made.settings.model_copy(update={"scene": longer}))
    told = answers_of(both)
    assert told.answers["thermometer"][0]["temperature"] == "22.4 C"
    assert len(told.answers["thermometer"]) == 1
    assert told.unsaid[0].startswith("boundary/long.csv: 120 readings")

    none = {name: value for name, value in told.answers.items() if name != "thermometer"}
    after = change_answers(both, none)

    files = [one.file for one in after.settings.scene.boundary if isinstance(one, PointSensors)]
    assert files == ["boundary/long.csv"]
    assert not (made.folder / "boundary" / "sensors.csv").exists()


def test_a_room_without_a_camera_towards_y_max_says_where_it_is_edited(by_hand: Experiment, tmp_path: Path):
    scene = by_hand.settings.scene
    side = replace(
        scene.views[0], wall="x_max", camera=replace(scene.views[0].camera, position_m=(-1.0, 1.5, 1.35))
    )
    other = create_experiment(
        tmp_path / "side",
        by_hand.settings.model_copy(
            update={
                "scene": replace(
                    scene,
                    views=(side,),
                    boundary=tuple(one for one in scene.boundary if not isinstance(one, PointSensors)),
                )
            }
        ),
    )
    with pytest.raises(BadInputError, match=r"No camera looks at the wall y_max.*experiment\.toml"):
        answers_of(other)
