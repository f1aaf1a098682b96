"""The examples run as they are written, on a small simulated experiment."""

import sys

import numpy as np
import pytest

from app.errors import BadInputError
from app.examples import draught_map, presets
from app.experiment.rig_settings import SimulatedCameraSettings
from app.simulate.experiment import simulate
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RigOptions
from tests.app.report.test_indoor import experiment  # noqa: F401


@pytest.fixture(scope="module")
def captured(tmp_path_factory):
    """Pictures of a small camera before the packaged room."""
    folder = tmp_path_factory.mktemp("examples") / "experiment"
    options = RigOptions(camera_px=(192, 144), frames=1)
    return simulate(
        SAMPLE_ROOM, folder, options, "surveyed", SimulatedCameraSettings(noise_free=True), cells=8
    )


def run(monkeypatch, capsys, example, *words: str) -> str:
    monkeypatch.setattr(sys, "argv", [example.__name__, *words])
    example.main()
    return capsys.readouterr().out


def test_from_a_kept_result_to_a_map_of_draught(experiment, tmp_path, monkeypatch, capsys):  # noqa: F811
    picture = tmp_path / "draught.png"
    said = run(monkeypatch, capsys, draught_map, str(experiment.folder), str(picture))
    assert "the draught is worst at x" in said
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = np.loadtxt(tmp_path / "draught.csv", delimiter=",", skiprows=1)
    assert rows.shape == (21 * 7, 5)
    assert (rows[:, 3] <= rows[:, 2] + 1e-3).all()
    assert (rows[:, 2] <= rows[:, 4] + 1e-3).all()


def test_a_sweep_over_presets_from_captures(captured, tmp_path, monkeypatch, capsys):
    said = run(monkeypatch, capsys, presets, str(captured), str(tmp_path / "c.png"), "--presets", "draft")
    assert said.splitlines()[1].startswith("draft")
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    # Its result has no velocity, and the other example says what to do.
    with pytest.raises(BadInputError, match="preset standard"):
        draught_map.draught_map(draught_map.finding_of(captured), tmp_path / "draught.png")
