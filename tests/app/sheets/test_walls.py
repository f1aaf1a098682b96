"""Several walls that bear a print: each one's own pattern in its own sheets, at the size of that wall."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from app.client import Client
from app.errors import BadInputError
from app.experiment.folder import open_experiment, save_settings
from app.experiment.printed import is_of_the_scene, read_printed
from app.sheets.pattern import choose_pattern, print_pattern, print_pattern_of
from core.render.light import texture_size
from core.scene import FixedTexture
from tests.app.api.conftest import live
from tests.app.commands.test_rig_commands import run
from tests.app.kiosk.test_projectors import experiment

__all__ = ["live"]
SIDE = "camera at x_max"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Both walls with a print that their cameras can see."""
    made = experiment(tmp_path / "two", "texture").folder
    choose_pattern(made)
    choose_pattern(made, SIDE)
    return made


def test_each_wall_has_its_own_pattern_at_its_own_size(folder: Path):
    scene = open_experiment(folder).settings.scene
    first, second = print_pattern_of(scene), print_pattern_of(scene, 1)
    _, depth_m, height_m = scene.room.size_m
    assert isinstance(second.light, FixedTexture)
    # x_max spans the room's depth; its pattern begins and ends within a pixel of it.
    assert second.cols * second.light.pixel_m == pytest.approx(depth_m, abs=2 * second.light.pixel_m)
    assert second.rows * second.light.pixel_m == pytest.approx(height_m, abs=2 * second.light.pixel_m)
    assert (first.rows, first.cols) == texture_size(scene.room, first.light.pixel_m)
    corner = slice(0, 50)
    assert not np.array_equal(first.picture(corner, corner), second.picture(corner, corner))


def test_the_records_are_kept_apart_and_each_is_held_against_its_own_wall(folder: Path):
    made = open_experiment(folder)
    path, first = print_pattern(made, "a1")
    beside, second = print_pattern(made, "a1", view=SIDE)
    assert (path.name, beside.name) == ("pattern-a1.pdf", f"pattern-{SIDE}-a1.pdf")
    assert (first.view, second.view) == (None, SIDE)
    assert read_printed(made, "pattern") == first
    assert read_printed(made, "pattern", 1) == second
    scene = made.settings.scene
    light = scene.views[1].light
    assert light is not None
    other = dataclasses.replace(light, pattern=dataclasses.replace(light.pattern, seed=77))
    views = (scene.views[0], dataclasses.replace(scene.views[1], light=other))
    changed = made.settings.model_copy(update={"scene": dataclasses.replace(scene, views=views)})
    now = save_settings(folder, changed)
    assert is_of_the_scene(first, now)
    assert not is_of_the_scene(second, now)


def test_the_command_line_prints_all_walls_or_the_one_that_is_named(folder: Path, tmp_path: Path):
    said = run("print", "pattern", str(folder), "--paper", "a0").stdout
    assert said.count("Print at 100 %") == 2
    with pytest.raises(BadInputError, match="2 walls bear a print: say whose with --view"):
        run("print", "pattern", str(folder), "--out", str(tmp_path / "one.pdf"))
    run("print", "pattern", str(folder), "--view", SIDE, "--out", str(tmp_path / "one.pdf"))
    assert (tmp_path / "one.pdf").read_bytes().startswith(b"%PDF")


def test_the_service_prints_the_wall_that_is_named(live, tmp_path: Path):
    folder = live.app.state.services.folders.root / "two"
    experiment(folder, "texture")
    with Client(live.url, live.token) as airlens:
        first = airlens.print_pattern("two", "a0", choose=True)
        second = airlens.print_pattern("two", "a0", choose=True, view=SIDE)
        assert [(one.view, one.is_of_the_scene) for one in airlens.prints("two")] == [
            (None, True),
            (SIDE, True),
        ]
        assert (first.view, second.view) == (None, SIDE)
        one = airlens.read_print("two", "pattern", tmp_path / "one.pdf")
        other = airlens.read_print("two", "pattern", tmp_path / "other.pdf", SIDE)
    assert one.read_bytes() != other.read_bytes()
