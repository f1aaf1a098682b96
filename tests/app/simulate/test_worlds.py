"""Worlds of a simulated rig: by name, changed value by value, one nuisance at a time, and entered wrongly."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from app.capture.burst import take
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.captures import newest_pair
from app.experiment.folder import open_experiment
from app.pipeline import reconstruct
from app.reconstruct.measure import between_references
from app.reconstruct.problem import known_of
from app.rig.open import air_of, open_camera
from app.rig.rendered import drifted
from app.simulate.rehearsal import Rehearsal, calibrate_simulated, rehearse
from app.simulate.worlds import IDEAL, LAB, changed, one_by_one
from app.volume.file import read_volume
from app.volume.misread import misread
from app.volume.scene import RigOptions, room_scene
from app.volume.score import score_experiment
from core.objects import RoomObject, ready_object
from core.scene import Inlet, Outlet
from drivers.burst import CapturePlan
from tests.app.capture.test_series import ROOM


def test_one_nuisance_at_a_time_and_then_all():
    worlds = one_by_one(LAB)
    names = [name for name in LAB.world.model_fields_set if name in worlds]
    assert len(names) == 10
    for name in names:
        spoiling = worlds[name].world.model_dump()
        assert spoiling[name] == getattr(LAB.world, name)
        assert sum(value != worlds["nothing"].world.model_dump()[key] for key, value in spoiling.items()) == 1
    assert worlds["all"] == LAB
    assert worlds["all, still border"].border == "print"
    assert worlds["all, marks"].marks
    assert worlds["all, bracketed"].bracketed
    assert worlds["entries misread"].misreads


def test_a_value_is_changed_by_its_name():
    found = changed(LAB, ["blur_px=1.5", "covered=0"], drift_px=0.2, border="print", misreads=False)
    assert (found.world.blur_px, found.world.covered, found.world.ripple) == (1.5, 0.0, LAB.world.ripple)
    assert (found.drift_px, found.border, found.misreads) == (0.2, "print", False)
    assert changed(IDEAL, []) == IDEAL


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("blurr_px=1", "no nuisance of a world; expected NAME=VALUE, one of blur_px"),
        ("blur_px", "expected NAME=VALUE"),
        ("blur_px=-1", "blur_px=-1.0: .*greater than or equal to 0"),
        ("covered=much", "'much' is no number"),
    ],
)
def test_a_nuisance_that_cannot_be_is_named(text, words):
    with pytest.raises(BadInputError, match=words):
        changed(IDEAL, [text])


def test_entries_are_as_wrong_as_their_deviations_say():
    scene = room_scene(read_volume(ROOM), RigOptions(camera_px=(64, 48)), "operator")
    (inlet,) = (item for item in scene.boundary if isinstance(item, Inlet))
    off = []
    for seed in range(200):
        read = misread(scene, seed)
        (entered,) = (item for item in read.boundary if isinstance(item, Inlet))
        (outlet,) = (item for item in read.boundary if isinstance(item, Outlet))
        speed = np.linalg.norm(entered.velocity_m_s) - np.linalg.norm(inlet.velocity_m_s)
        off.append([(entered.temperature_k - inlet.temperature_k) / 0.1, speed / inlet.velocity_std_m_s])
        assert outlet.temperature_std_k == 0.1
    # 200 draws: their deviation is known to 5 %; three sigma.
    np.testing.assert_allclose(np.std(off, axis=0), 1.0, atol=0.15)
    assert misread(scene, 3) == misread(scene, 3)


def test_the_heat_of_an_object_is_judged_as_wrong_as_its_deviation_says():
    seated = ready_object("seated_person", "somebody", (1.0, 0.0, 0.0))
    warm = RoomObject(
        name="warm",
        lower_m=(0.0, 0.5, 0.0),
        upper_m=(0.4, 0.9, 1.0),
        thermal="temperature",
        temperature_k=300.0,
    )
    desk = ready_object("desk", "desk", (2.0, -1.0, 0.0))
    scene = room_scene(read_volume(ROOM), RigOptions(camera_px=(64, 48)), "operator")
    read = [misread(replace(scene, objects=(seated, warm, desk)), seed).objects for seed in range(200)]
    off = [
        ((one.power_w - 75.0) / seated.power_std_w, (two.temperature_k - 300.0) / warm.temperature_std_k)
        for one, two, _ in read
    ]
    # 200 draws: their deviation is known to 5 %; three sigma.
    np.testing.assert_allclose(np.std(off, axis=0), 1.0, atol=0.15)
    assert all(objects[2] == desk for objects in read)


def test_a_labs_world_is_what_simulate_shows_unless_it_is_asked_for_the_ideal_one(tmp_path):
    cameras, stand_offs_m = [], []
    for name, words in {"lab": [], "ideal": ["--world", "ideal"]}.items():
        arguments = [
            "simulate",
            str(tmp_path / name),
            "--truth",
            str(ROOM),
            "--camera-px",
            "160",
            "--frames",
            "2",
        ]
        done = CliRunner().invoke(create_cli(), [*arguments, *words], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        settings = open_experiment(tmp_path / name).settings
        cameras.append(settings.rig.camera)
        stand_offs_m.append(settings.scene.room.upper_m[1] - settings.scene.views[0].camera.position_m[1])
    assert cameras == [LAB.camera(0), IDEAL.camera(0)]
    assert stand_offs_m == pytest.approx([4.0, 30.5])


def test_marks_and_a_second_reference_are_asked_for_by_name(tmp_path):
    folder = tmp_path / "e"
    arguments = ["simulate", str(folder), "--truth", str(ROOM), "--camera-px", "320", "--frames", "20"]
    words = ["--marks", "--bracketed", "--set", "covered=0", "--set", "breathing_px=0"]
    done = CliRunner().invoke(create_cli(), [*arguments, *words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    experiment = open_experiment(folder)
    scene = known_of(experiment).scene
    assert [marks.name for marks in scene.views[0].marks] == ["left board", "right board"]
    captures = newest_pair(experiment)
    assert set(captures.names) == {"reference", "flow", "after"}
    # The mount took a step before the flow, and another one after it.
    moved = between_references(captures, scene)
    assert moved.agree
    camera = scene.views[0].camera
    turns = [drifted(scene, 0, LAB.drift_px, 0.0, seed).views[0].camera for seed in (0, 1)]
    # Where each step carries what was seen in the middle.
    walked = np.sum([camera.focal_px[0] * (turn.rotation @ camera.rotation[2])[:2] for turn in turns], axis=0)
    assert tuple(moved.middle_px) == pytest.approx(tuple(walked), abs=0.02)


def test_a_rehearsal_stands_in_a_lab_and_its_pictures_find_the_temperature(tmp_path):
    experiment = rehearse(tmp_path, Rehearsal())
    assert experiment.settings.rig.camera == LAB.camera(0)
    exact = room_scene(read_volume(ROOM), RigOptions(camera_px=(384, 288), stand_off_m=4.0), "surveyed")
    assert experiment.settings.scene.boundary == misread(exact, 0).boundary
    assert rehearse(tmp_path, Rehearsal(world="ideal")).settings.scene.boundary == exact.boundary
    calibrate_simulated(experiment)
    for role in ("reference", "flow"):
        with open_camera(experiment, air_of(role)) as camera:
            take(camera, experiment, CapturePlan(role=role, frames=20))
    reconstruct(experiment.folder, "draft")
    scores = score_experiment(experiment.folder, ROOM)
    assert scores["T"]["rms_K"] < scores["T"]["trivial"]["inlet_plane"]


def test_a_labs_world_is_simulated_captured_and_kept_in_the_experiment(tmp_path):
    folder = tmp_path / "e"
    arguments = ["simulate", str(folder), "--truth", str(ROOM), "--camera-px", "320x240", "--frames", "8"]
    done = CliRunner().invoke(create_cli(), [*arguments, "--set", "blur_px=0.4"])
    assert done.exit_code == 0, done.output

    experiment = open_experiment(folder)
    camera = experiment.settings.rig.camera
    assert camera.world.blur_px == 0.4
    assert camera.world.covered == LAB.world.covered
    assert (camera.border, camera.drift_px) == ("bare", 0.3)
    exact = room_scene(read_volume(ROOM), RigOptions(camera_px=(320, 240), stand_off_m=4.0), "operator")
    assert experiment.settings.scene.boundary == misread(exact, 0).boundary
    pair = newest_pair(experiment)
    # Nothing is beyond the wall, and the corners of the wall are darker.
    assert pair.reference.images[0].mean[0].mean() < 0.02
