"""A capture is told when its calibration does not fit it, and how far the border moved."""

import dataclasses
import json
from datetime import UTC, datetime, timedelta

import pytest
from typer.testing import CliRunner

from app.capture.burst import take
from app.capture.checks import aged
from app.cli import create_cli
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import Experiment, ExperimentSettings, create_experiment
from app.experiment.rig_settings import ProjectorSettings, RigSettings, SimulatedCameraSettings
from app.rig.conditions import Conditions, conditions_of
from calibration.bundle import given_bundle, to_json
from core.geometry import Box, Optics
from core.scene import FixedTexture, ProjectedPattern, Scene, View
from drivers.burst import CapturePlan
from drivers.projector.lamp_guard import LampGuard
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern

OPTICS = Optics(
    position_m=(0.0, -3.0, 0.0), rotation_rad=(0.0, 0.0, 0.0), width_px=128, height_px=96,
    focal_px=(200.0, 200.0), principal_px=(63.5, 47.5),
)  # fmt: skip
ROOM = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))


@pytest.fixture
def experiment(tmp_path) -> Experiment:
    scene = Scene(room=ROOM, views=(View(camera=OPTICS),), light=FixedTexture())
    made = create_experiment(tmp_path / "experiment", ExperimentSettings(scene=scene))
    made.bundle_path.parent.mkdir()
    old = (datetime.now(UTC) - timedelta(days=30)).isoformat(timespec="seconds")
    bundle = given_bundle(date=old, cameras={"camera": OPTICS}, projector=None, noise={}, back_wall_y_m=1.0)
    warm = dataclasses.replace(bundle, ambient_temperature_k=299.0, minutes_on=60.0)
    made.bundle_path.write_text(to_json(warm))
    return made


def make_camera() -> SimulatedCamera:
    view = pattern()
    return SimulatedCamera(lambda: view, seed=1)


def test_a_capture_says_that_its_calibration_is_old_and_cold_and_the_result_will_too(experiment):
    told = Conditions(ambient_temperature_k=293.0, minutes_on=4.0)
    for role in ("reference", "flow"):
        taken = take(make_camera(), experiment, CapturePlan(role=role, frames=3), told=told)
    advice = [v.advice for v in taken.burst.verdicts if v.name == "calibration"]
    assert len(advice) == 3
    assert "30 days older" in advice[0]
    assert "-6.0 K" in advice[1]
    assert "60 minutes at the calibration and for 4 at the capture" in advice[2]
    manifest = load_capture(experiment.latest_capture("flow")).manifest
    assert manifest["origin"]["minutes_on"] == 4.0
    assert [v["name"] for v in manifest["views"][0]["verdicts"]].count("calibration") == 3
    # On for four minutes is also what the warm-up verdict is about.
    assert any(v.name == "warm-up" and not v.good for v in taken.burst.verdicts)

    found = aged(experiment, newest_pair(experiment))

    assert len(found) == 6
    assert found[0].startswith("The reference capture: The calibration is 30 days older")
    assert any(text.startswith("The flow capture: The room is -6.0 K") for text in found)


def test_a_flow_says_how_far_the_border_moved(experiment):
    camera = make_camera()
    take(camera, experiment, CapturePlan(role="reference", frames=8))
    camera.shift_px = (0.3, -0.4)
    taken = take(camera, experiment, CapturePlan(role="flow", frames=8))
    (drift,) = [v for v in taken.burst.verdicts if v.name == "border drift"]
    assert drift.good
    assert drift.value == pytest.approx(0.5, abs=0.03)

    camera.shift_px = (2.0, 0.0)
    (far,) = [
        v
        for v in take(camera, experiment, CapturePlan(role="flow", frames=8)).burst.verdicts
        if v.name == "border drift"
    ]
    assert not far.good
    assert "+2.0" in far.advice


@pytest.mark.parametrize(("exposure_s", "good"), [(0.02, True), (0.01, False)])
def test_a_flow_says_whether_its_exposure_is_the_references(experiment, exposure_s, good):
    camera = make_camera()
    take(camera, experiment, CapturePlan(role="reference", frames=2, exposure_s=0.02))
    taken = take(camera, experiment, CapturePlan(role="flow", frames=2, exposure_s=exposure_s))
    (told,) = [v for v in taken.burst.verdicts if v.name == "exposure_s of the reference"]
    assert told.good is good
    assert told.value == pytest.approx(abs(exposure_s / 0.02 - 1.0), abs=1e-3)


def test_the_lamps_journal_tells_how_long_it_has_been_on(experiment, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    now_s = datetime.now(UTC).timestamp()
    state = tmp_path / ".local" / "state" / "airlens"
    for port, lit_s in ((0, now_s - 1800), (1, now_s - 600)):
        journal = state / f"lamp-escvp21--dev-ttyUSB{port}.json"
        LampGuard(journal=journal, now_s=lambda at_s=lit_s: at_s).lit()
    first, further = (ProjectorSettings(url=f"escvp21:/dev/ttyUSB{port}") for port in (0, 1))
    # Of several lamps, the one that was lit last.
    for further_ones, minutes in ((None, 30), ({"second": further}, 10)):
        rig = RigSettings(projector=first, projectors=further_ones)
        settings = experiment.settings.model_copy(update={"rig": rig})
        known = conditions_of(settings, Conditions())
        assert known.minutes_on == pytest.approx(minutes, abs=0.2)
        assert known.ambient_temperature_k == settings.scene.air.ambient_temperature_k


def test_the_camera_sees_what_the_simulated_projector_shows(tmp_path):
    camera = dataclasses.replace(OPTICS, width_px=384, height_px=288, focal_px=(700.0, 700.0))
    camera = dataclasses.replace(
        camera, principal_px=(191.5, 143.5), rotation_rad=(1.5707963267948966, 0.0, 0.0)
    )
    projector = dataclasses.replace(camera, position_m=(0.2, -3.0, 0.0), focal_px=(900.0, 900.0))
    scene = Scene(room=ROOM, views=(View(camera=camera),), light=ProjectedPattern(projector=projector))
    folder = tmp_path / "experiment"
    rig = RigSettings(camera=SimulatedCameraSettings())
    create_experiment(folder, ExperimentSettings(scene=scene, rig=rig))

    done = CliRunner().invoke(create_cli(), ["projector", "check", str(folder), "--json"])

    assert done.exit_code == 0, done.output
    verdict = json.loads(done.stdout)
    assert verdict["good"]
    assert verdict["value"] > 0.9
    lit_otherwise = tmp_path / "texture"
    create_experiment(
        lit_otherwise,
        ExperimentSettings(scene=dataclasses.replace(scene, light=FixedTexture())),
    )
    refused = CliRunner().invoke(create_cli(), ["projector", "check", str(lit_otherwise)])
    assert "nothing to project" in str(refused.exception)
