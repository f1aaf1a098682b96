"""An operator with the simulated rig: look, take reference and flow, watch, take a sequence."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.simulate.experiment import simulate
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.scene import RigOptions
from drivers.errors import DeviceNotFoundError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    options = RigOptions(camera_px=(160, 120), frames=2)
    camera = SimulatedCameraSettings(drift_px=0.3)
    return simulate(SAMPLE_ROOM, tmp_path_factory.mktemp("story") / "experiment", options, "surveyed", camera)


def run(*words):
    result = CliRunner().invoke(create_cli(), [str(word) for word in words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]


def test_a_preview_judges_one_frame_and_writes_a_picture(folder, tmp_path):
    (seen,) = run("preview", folder, "--out", tmp_path / "now.png", "--json")
    assert {v["name"] for v in seen["verdicts"]} == {"level", "contrast", "focus", "saturation"}
    assert (tmp_path / "now.png").stat().st_size > 1000


def test_captures_land_in_the_experiment_and_a_sequence_has_its_times(folder):
    (taken,) = run("capture", "reference", folder, "--frames", 6, "--exposure-s", 0.02, "--json")
    assert taken["outcome"] == "complete"
    assert taken["settings"]["exposure_s"] == {"asked": 0.02, "granted": 0.02}
    assert open_experiment(folder).latest_capture("reference") == Path(taken["folder"])
    three = run("capture", "flow", folder, "--frames", 2, "--bursts", 3, "--every-s", 0.2, "--json")
    assert len({one["folder"] for one in three}) == 3
    (raw,) = run("capture", "flow", folder, "--frames", 2, "--raw-stack", "--json")
    assert (Path(raw["folder"]) / "frames.tif").exists()


def test_the_watch_tells_drift_from_what_moves_inside(folder):
    looks = run("capture", "watch", folder, "--count", 2, "--every-s", 0, "--json")
    assert len(looks) == 2
    for look in looks:
        # The rig drifted by 0.3 px and rolled as much at the edge; one frame is noisy.
        assert abs(look["drift_px"][0]) + abs(look["drift_px"][1]) < 1.0


def test_a_real_camera_that_is_not_there_is_said(folder, tmp_path):
    text = (folder / "experiment.toml").read_text()
    start, end = text.index("[rig.camera]"), text.index("[scene.room]")
    camera = f'[rig.camera]\nkind = "v4l2"\ndevice = "{tmp_path}/video0"\n'
    camera += "width_px = 320\nheight_px = 240\nexposure_s = 0.02\n\n"
    other = tmp_path / "experiment"
    other.mkdir()
    (other / "experiment.toml").write_text(text[:start] + camera + text[end:])
    with pytest.raises(DeviceNotFoundError, match="airlens devices"):
        run("preview", other)
    refused = CliRunner().invoke(create_cli(), ["capture", "flow", str(other), "--on-abort", "burn"])
    assert refused.exit_code == 2
    assert "'burn'" in refused.output
