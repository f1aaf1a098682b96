"""Two walls, each lit by its own projector: each pattern reaches a page of its own."""

import json
import subprocess
import sys
from pathlib import Path

import httpx
import numpy as np
import pytest

from app.client import Client, ServiceError
from app.errors import BadInputError
from app.experiment.folder import Experiment, ExperimentSettings, create_experiment
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.kiosk.screens import page_of
from app.rig.patterns import pattern_picture
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RigOptions, room_scene
from drivers.display import picture_digest
from tests.app.api.conftest import live
from tests.app.commands.test_rig_commands import run

__all__ = ["live"]


def experiment(folder: Path, light: str = "projector") -> Experiment:
    """Two cameras before the walls y_max and x_max, each wall with its own light."""
    options = RigOptions(camera_px=(96, 72), walls=("y_max", "x_max"), light=light)
    scene = room_scene(read_volume(SAMPLE_ROOM), options, "surveyed")
    rig = RigSettings(camera=SimulatedCameraSettings())
    return create_experiment(folder, ExperimentSettings(rig=rig, scene=scene))


def play(at: str) -> str:
    """Do what a page at that address does: look, fetch, report. Returns what it shows."""
    with httpx.Client(base_url=at.removesuffix("page"), trust_env=False) as client:
        frame = client.get("frame").json()
        data = client.get(f"frames/{frame['id']}").content
        digest = picture_digest(np.frombuffer(data, np.uint8).reshape(frame["height_px"], frame["width_px"]))
        size = {"width_px": frame["width_px"], "height_px": frame["height_px"], "device_pixel_ratio": 1.0}
        client.post("report", json={"id": frame["id"], "digest": digest, "reason": ""} | size)
    return digest


def test_the_command_line_serves_a_page_for_each_projector(tmp_path: Path):
    made = experiment(tmp_path / "two")
    wanted = [picture_digest(pattern_picture(made, "scene", number)) for number in (0, 1)]
    command = [
        sys.executable,
        "-c",
        "from app.cli import main; main()",
        "kiosk",
        str(made.folder),
        "--port",
        "0",
        "--once",
        "--json",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as kiosk:
        assert kiosk.stdout is not None
        addresses = [json.loads(kiosk.stdout.readline())["address"] for _ in (0, 1)]
        # As pages do: asked again until the picture is there.
        shown: list[str] = []
        while len(shown) < 2:
            frame = httpx.get(addresses[len(shown)].removesuffix("page") + "frame", trust_env=False).json()
            if frame["id"]:
                shown.append(play(addresses[len(shown)]))
        told = [json.loads(line) for line in kiosk.stdout]
    assert kiosk.returncode == 0
    assert [one.split("/kiosk")[1] for one in addresses] == ["/page", "/1/page"]
    assert shown == wanted
    assert wanted[0] != wanted[1]
    assert [(one["view"], one["digest"]) for one in told] == [
        (view.name, digest) for view, digest in zip(made.settings.scene.views, wanted, strict=True)
    ]


def test_what_cannot_be_shown_is_said(tmp_path: Path):
    printed = experiment(tmp_path / "printed", "texture")
    with pytest.raises(BadInputError, match="printed texture: there is nothing to project"):
        run("kiosk", str(printed.folder))
    thrown = experiment(tmp_path / "thrown")
    with pytest.raises(BadInputError, match="no view 'left'; its views are 'camera', 'camera at x_max'"):
        run("kiosk", str(thrown.folder), "--view", "left")
    with pytest.raises(BadInputError, match="expected one of scene, identify"):
        run("kiosk", str(thrown.folder), "--pattern", "stars")
    with pytest.raises(BadInputError, match="A card shows one picture, and there are the projectors of"):
        run("kiosk", str(thrown.folder), "--screen", "/dev/dri/card9")
    with pytest.raises(BadInputError, match="give the experiment's folder"):
        run("kiosk", "--identify", "64x48", "--view", "camera")


def test_the_service_shows_each_pattern_on_its_own_page(live):
    made = experiment(live.app.state.services.folders.root / "two")
    with Client(live.url, live.token) as airlens:
        put = airlens.show_pattern("two", view=1)
        assert (put.view, put.state, put.page) == (1, "waiting", page_of(1))
        assert put.digest == picture_digest(pattern_picture(made, "scene", 1))
        assert airlens.screen().state == "empty"
        assert airlens.screen(view=1).digest == put.digest
        assert airlens.preview_pattern("two", view=0) != airlens.preview_pattern("two", view=1)
        with pytest.raises(ServiceError, match="2 views; there is no view 2"):
            airlens.show_pattern("two", view=2)
        assert airlens.clear_screen(view=1).state == "empty"
        lamps = [one.lamp for one in airlens.experiment("two").views]
    assert lamps == [0, 1]
