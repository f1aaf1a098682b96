"""What comes next, step by step along the whole work, and where `airlens` alone says that one is."""

import json
import os
import shlex
import subprocess
import sys
from dataclasses import replace

from typer.testing import CliRunner

from app.calibrate.parts import Part, StepName
from app.cli import create_cli
from app.experiment.folder import create_experiment, save_settings, write_manifest
from app.experiment.rig_settings import (
    BoardSettings,
    RigSettings,
    SimulatedCameraSettings,
    V4l2CameraSettings,
)
from app.sheets.pattern import print_pattern
from app.whereabouts import Step, next_step, whereabouts
from core.scene import Inlet, PointSensors, Wall
from tests.app.files.test_toml import example
from tests.app.sheets.test_pattern import experiment as printable
from tests.app.test_imports import HEAVY

CAMERA = V4l2CameraSettings(kind="v4l2", width_px=320, height_px=240, exposure_s=0.02)


def following(folder):
    return whereabouts(folder, "EXP").next.command


def finish(folder, **manifest):
    folder.mkdir(parents=True)
    write_manifest(folder, manifest)
    return folder


def with_rig(made, **rig):
    return save_settings(made.folder, made.settings.model_copy(update={"rig": RigSettings(**rig)}))


def calibrated(monkeypatch, missing=()):
    parts = tuple(Part(name, "missing" if name.value in missing else "measured") for name in StepName)
    monkeypatch.setattr("app.whereabouts.parts_of", lambda experiment: parts)


def test_each_step_that_is_done_leads_to_the_next_one(tmp_path, monkeypatch):
    made = printable(tmp_path / "wall")
    scene = replace(made.settings.scene, boundary=(Wall(wall="z_min"),))
    made = save_settings(made.folder, made.settings.model_copy(update={"scene": scene}))
    folder = made.folder
    assert following(folder) == "airlens devices --full"
    made = with_rig(made, camera=CAMERA)
    assert following(folder) == "airlens plan EXP"
    (folder / "plan.json").write_text("{}")
    assert following(folder) == "airlens print pattern EXP"
    print_pattern(made, "a0")
    assert following(folder) == "airlens print board EXP"
    made = with_rig(made, camera=CAMERA, board=BoardSettings(columns=9, rows=6, square_m=0.03))
    assert following(folder) == "airlens calibrate camera EXP"
    calibrated(monkeypatch, missing=("wall",))
    assert following(folder) == "airlens calibrate wall EXP"
    calibrated(monkeypatch)
    assert following(folder) == "airlens capture reference EXP --frames 100"
    finish(folder / "captures" / "20260101T000000-reference", role="reference")
    assert following(folder) == "airlens capture flow EXP --frames 100"
    finish(folder / "captures" / "20260101T000001-flow", role="flow")
    assert following(folder) == "airlens reconstruct EXP"
    used = {"reference": "20260101T000000-reference", "flow": "20260101T000001-flow"}
    result = finish(folder / "results" / "20260101T000002-draft", captures=used)
    assert "lost its result.nc" in whereabouts(folder, "EXP").next.reason
    (result / "result.nc").write_text("")
    assert following(folder) == "airlens report EXP"
    (result / "report.html").write_text("")
    assert following(folder) == "airlens export EXP"
    (folder / "checkpoint").mkdir()
    assert following(folder) == "airlens reconstruct EXP"
    (folder / "checkpoint").rmdir()
    finish(folder / "captures" / "20260101T000003-flow", role="flow")
    found = whereabouts(folder, "EXP")
    assert found.next.command == "airlens reconstruct EXP"
    assert "newer captures" in found.next.reason
    assert found.has["captures"] == "1 reference, 2 flow"
    assert "20260101T000002-draft" in found.has["results"]


def test_a_scene_that_is_refused_is_told_before_it_is_reconstructed(tmp_path, monkeypatch):
    made = create_experiment(tmp_path / "room", example(rig=RigSettings(camera=SimulatedCameraSettings())))
    folder, scene = made.folder, made.settings.scene
    assert "scene" not in whereabouts(folder).has
    (folder / "plan.json").write_text("{}")
    calibrated(monkeypatch)
    for role in ("reference", "flow"):
        finish(folder / "captures" / f"20260101T000000-{role}", role=role)
    inlet = next(one for one in scene.boundary if isinstance(one, Inlet))
    outwards = replace(inlet, velocity_m_s=tuple(-v for v in inlet.velocity_m_s))
    for boundary, words in (
        ((outwards,), "at (-0.5, 0, 0) m/s, which does not enter"),
        ((inlet, inlet), "overlap"),
        ((inlet, PointSensors(file="boundary/none.csv")), "none.csv"),
    ):
        wrong = replace(scene, boundary=boundary)
        save_settings(folder, made.settings.model_copy(update={"scene": wrong}))
        found = whereabouts(folder)
        assert words in found.has["scene"]
        assert words in found.next.reason
        assert found.next.step is Step.reconstruct


def test_a_command_can_be_pasted_where_the_folder_has_a_space(tmp_path):
    folder = tmp_path / "Mein Buero" / "exp 1"
    create_experiment(folder, example(rig=RigSettings(camera=SimulatedCameraSettings())))
    command = whereabouts(folder).next.command
    assert shlex.split(command) == ["airlens", "plan", str(folder)]
    said = alone("status", folder.parent)
    assert command in said
    assert said.startswith("1 experiment in ")


def test_a_pattern_that_is_no_longer_the_scenes_is_printed_again(tmp_path):
    made = with_rig(printable(tmp_path / "wall"), camera=CAMERA)
    (made.folder / "plan.json").write_text("{}")
    print_pattern(made, "a0")
    scene = made.settings.scene
    light = replace(scene.light, pattern=replace(scene.light.pattern, seed=8))
    save_settings(made.folder, made.settings.model_copy(update={"scene": replace(scene, light=light)}))
    found = whereabouts(made.folder, "EXP")
    assert found.next.command == "airlens print pattern EXP"
    assert "another" in found.next.reason
    assert "of another pattern" in found.has["print"]


def test_a_simulated_rig_needs_no_paper(tmp_path):
    made = create_experiment(tmp_path / "room", example(rig=RigSettings(camera=SimulatedCameraSettings())))
    (made.folder / "plan.json").write_text("{}")
    assert following(made.folder) == "airlens calibrate camera EXP"


def alone(*words):
    told = CliRunner().invoke(create_cli(), [str(word) for word in words])
    assert told.exit_code == 0, told.output
    return told.output


def test_alone_it_says_where_one_is(tmp_path, monkeypatch):
    made = create_experiment(tmp_path / "data" / "experiments" / "room", example(title="A room"))
    (tmp_path / "data" / "experiments" / "broken").mkdir()
    (tmp_path / "data" / "experiments" / "broken" / "experiment.toml").write_text("titel = 1")
    monkeypatch.chdir(made.folder)
    assert "A room" in alone()
    assert "Next: airlens devices --full" in alone()
    monkeypatch.chdir(tmp_path / "data")
    said = alone()
    assert "2 experiments" in said
    assert "experiments/room  A room\n    next: airlens devices" in said
    assert "line 1, column 1: unknown key 'titel'" in said
    assert "airlens serve" in said
    assert alone("status") == said
    told = json.loads(alone("status", made.folder, "--json"))
    assert told["next"]["command"] == "airlens devices --full"


def test_elsewhere_it_lists_the_commands_in_the_order_of_the_work_and_loads_nothing(tmp_path):
    code = (
        "import sys\nfrom app.cli import main\nsys.argv = ['airlens']\n"
        "try:\n    main()\nexcept SystemExit as done:\n    assert not done.code\n"
        f"print('loaded', *[name for name in {HEAVY!r} if name in sys.modules])"
    )
    ran = subprocess.run(
        [sys.executable, "-P", "-c", code],
        capture_output=True, text=True, check=True, cwd=tmp_path, env=os.environ | {"COLUMNS": "200"},
    )  # fmt: skip
    assert ran.stdout.splitlines()[-1] == "loaded"
    work = (
        "new",
        "devices",
        "preview",
        "plan",
        "print",
        "calibrate",
        "capture",
        "reconstruct",
        "report",
        "export",
    )
    places = [ran.stdout.index(f"│ {name} ") for name in work]
    assert places == sorted(places)
    assert "airlens new --template" in ran.stdout


def test_a_folder_without_experiments_is_said_to_be_one(tmp_path):
    told = CliRunner().invoke(create_cli(), ["status", str(tmp_path)])
    assert "is no experiment, and holds none" in str(told.exception)


def test_what_is_only_advised_is_passed_over_by_the_page(tmp_path):
    made = with_rig(printable(tmp_path / "wall"), camera=CAMERA)
    assert next_step(made, "EXP").step is Step.plan
    assert next_step(made, "EXP", advised=False).step is Step.calibrate
