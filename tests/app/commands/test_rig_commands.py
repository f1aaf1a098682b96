"""`airlens devices`, `projector` and `kiosk` as an operator types them."""

import json

import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.errors import BadInputError
from drivers.clock import SystemClock
from drivers.errors import DeviceRefusedError, DeviceSettingError
from drivers.simulated.projector.hosts import PtyHost
from tests.drivers.projector.twins import make_twin


def run(*words):
    result = CliRunner().invoke(create_cli(), list(words))
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_devices_are_listed_as_json_and_in_words():
    found = json.loads(run("devices", "--json").stdout)
    assert set(found) == {"cameras", "vision_cameras", "serial_ports"}
    assert run("devices").stdout


def test_a_projector_is_asked_and_told_and_its_lamp_is_guarded_across_runs(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    twin = make_twin("benq", clock=SystemClock())
    twin.responder.state.warm_up_s = 0.0
    with PtyHost(twin, tmp_path / "projector") as host:
        url = f"benq:{host.path}"
        assert json.loads(run("projector", "status", url, "--json").stdout)["power"] == "standby"
        assert json.loads(run("projector", "on", url, "--json").stdout) == {"done": "on", "power": "on"}
        run("projector", "mute", url)
        assert twin.responder.state.muted
        said = run("projector", "status", url, "--wire")
        assert "muted: True" in said.stdout
        assert "*pow=?#" in said.stderr
        # Another process, the same lamp.
        with pytest.raises(DeviceRefusedError, match="lit only just now"):
            run("projector", "off", url)


def test_a_wrong_projector_or_picture_is_said(tmp_path):
    with pytest.raises(DeviceSettingError, match="one of escvp21"):
        run("projector", "status", "vga:/dev/null")
    with pytest.raises(BadInputError, match="WIDTHxHEIGHT"):
        run("kiosk")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(BadInputError, match="not a grey picture"):
        run("kiosk", str(tmp_path / "text.png"))
