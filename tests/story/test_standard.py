"""`standard` on a small room, by the commands that a user types: simulate, reconstruct, score."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from tests.rooms import ROOM, state_grid


def airlens(*words: object) -> str:
    done = CliRunner().invoke(create_cli(), [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.timeout(1500)
def test_a_small_surveyed_room_is_found_by_the_command_line_with_velocity_and_pressure(tmp_path: Path):
    folder = tmp_path / "room"
    options = (
        "--truth",
        ROOM,
        "--information",
        "surveyed",
        "--camera-px",
        160,
        "--frames",
        2,
        "--world",
        "ideal",
    )
    airlens("simulate", folder, *options)
    state_grid(folder, 8)
    said = airlens("reconstruct", folder, "--preset", "standard")
    assert "Where people are the air is" in said
    assert "To know better: " in said

    scores = json.loads(airlens("score", folder, "--truth", ROOM, "--json"))

    # Eight cells an edge hardly carry the jet. Air at the ambient temperature is 6.6 K wrong, still air scores 1.
    assert scores["preset"] == "standard"
    assert scores["T"]["rms_K"] < 1.8
    assert scores["u"]["rel"] < 0.95
    assert scores["u"]["jet_rel"] < 0.8
    assert scores["p"]["rel"] < 0.1
    # And it says how wrong it is, but for what so coarse a grid gets wrong.
    assert scores["T_within"] > 0.75
    # Surer than it should be: on one grid of eight cells nothing tells the grid's own error.
    assert scores["u_within"] > 0.75
