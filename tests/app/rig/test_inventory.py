"""A camera of the network is found, offered, opened by its experiment, and captured with."""

import json

from typer.testing import CliRunner

from app.cli import create_cli
from app.files.toml import to_toml, toml_data
from app.rig.inventory import found_cameras
from app.setup.experiment import new_experiment, template
from tests.drivers.aravis.fake import ADDRESS, fake_camera, missing, opened


def run(*words):
    result = CliRunner().invoke(create_cli(), [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@missing
def test_a_gige_camera_is_offered_and_captured_with(tmp_path):
    with fake_camera("-s", "LAB3"):
        opened().close()
        (found,) = [one for one in found_cameras() if one.kind == "aravis" and ADDRESS in one.name]
        assert [one.text for one in found.formats] == ["Mono16 2048x2048", "Mono8 2048x2048"]
        assert "Mono16  2048x2048" in run("devices")
        answers = toml_data(template("empty"), "empty")
        answers["camera"] |= {
            "kind": "aravis",
            "device": found.device,
            "pixel_format": "Mono8",
            "bits": 8,
            "width_px": 256,
            "height_px": 128,
            "exposure": "10 ms",
        }
        made = new_experiment(tmp_path / "lab", to_toml(answers), "answers")
        assert made.settings.rig.addresses == (found.device,)
        run("capture", "reference", made.folder, "--frames", 5)
    (manifest,) = (tmp_path / "lab" / "captures").glob("*/manifest.json")
    (view,) = json.loads(manifest.read_text())["views"]
    assert view["frames"] == 5
    assert "LAB3" in view["camera"]["name"]
