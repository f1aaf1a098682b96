"""Each projector's pattern is seen by its own camera, or the line that says otherwise says whose it is."""

import dataclasses
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from app.capture.pattern_check import check_projectors
from app.errors import AirlensError, BadInputError
from app.experiment.folder import Experiment, ExperimentSettings, create_experiment
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings, V4l2CameraSettings
from app.rig.lamps import Lamps
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RigOptions, room_scene
from core.scene import FixedTexture, ProjectedPattern, Scene
from drivers.clock import SystemClock
from drivers.display import Picture, picture_digest
from drivers.projector.protocol import Projector
from drivers.simulated import SimulatedCamera
from drivers.simulated.projector.open import open_twin
from drivers.verdict import Verdict
from tests.app.commands.test_rig_commands import run

NAMES = ("camera", "camera at x_max")


def two_walls() -> Scene:
    """Two cameras before the walls y_max and x_max, each wall with a projector of its own."""
    options = RigOptions(camera_px=(192, 144), walls=("y_max", "x_max"), light="projector")
    return room_scene(read_volume(SAMPLE_ROOM), options, "surveyed")


def simulated(folder: Path, scene: Scene) -> str:
    rig = RigSettings(camera=SimulatedCameraSettings())
    return str(create_experiment(folder, ExperimentSettings(rig=rig, scene=scene)).folder)


def lit_by(scene: Scene, view: int, **changed) -> Scene:
    """The same with the projector of a view changed."""
    light = scene.views[view].light or scene.light
    assert isinstance(light, ProjectedPattern)
    light = dataclasses.replace(light, projector=dataclasses.replace(light.projector, **changed))
    views = [dataclasses.replace(one, light=light) if n == view else one for n, one in enumerate(scene.views)]
    return dataclasses.replace(scene, views=tuple(views))


def test_every_projector_is_checked_or_the_one_of_a_view(tmp_path):
    folder = simulated(tmp_path / "two", two_walls())
    told = [json.loads(line) for line in run("projector", "check", folder, "--json").stdout.splitlines()]
    assert [(one["view"], one["good"]) for one in told] == [(name, True) for name in NAMES]
    (line,) = run("projector", "check", folder, "--view", NAMES[1]).stdout.splitlines()
    assert line.startswith(f"{NAMES[1]}: seen is sent: 0.9")
    with pytest.raises(BadInputError, match="no view 'left'; its views are 'camera', 'camera at x_max'"):
        run("projector", "check", folder, "--view", "left")


def test_one_that_is_not_seen_is_named_and_keeps_none_of_the_others_from_their_check(tmp_path):
    scene = two_walls()
    light = scene.views[0].light or scene.light
    assert isinstance(light, ProjectedPattern)
    wide = lit_by(scene, 0, focal_px=tuple(0.5 * f for f in light.projector.focal_px))
    folder = simulated(tmp_path / "wide", wide)
    with pytest.raises(AirlensError, match=r"^camera: The camera does not see the identify frame's top left"):
        run("projector", "check", folder)
    one = run("projector", "check", folder, "--view", NAMES[1])
    assert one.stdout.startswith(f"{NAMES[1]}: seen is sent: 0.9")


def test_a_wall_that_bears_a_print_has_no_projector_to_check(tmp_path):
    scene = two_walls()
    printed = dataclasses.replace(scene.views[0], light=FixedTexture())
    folder = simulated(tmp_path / "one", dataclasses.replace(scene, views=(printed, scene.views[1])))
    assert json.loads(run("projector", "check", folder, "--json").stdout)["view"] == NAMES[1]
    with pytest.raises(BadInputError, match="printed texture: there is nothing to project"):
        run("projector", "check", folder, "--view", NAMES[0])


class Wall:
    """A wall that two projectors light, each with what its page shows, and a camera before it."""

    def __init__(self) -> None:
        self.twins = [open_twin("pjlink", SystemClock(), 0.0, 0.0) for _ in range(2)]
        for twin in self.twins:
            twin.turn_on()
            twin.power()
        self.shown: dict[int, Picture] = {}
        self.pages: list[threading.Thread] = []

    def say(self, text: str) -> None:
        """Open the page of the address that was said."""
        address, number = text.split()[1], len(self.pages)
        self.pages.append(threading.Thread(target=self._draw, args=(address.removesuffix("page"), number)))
        self.pages[-1].start()

    def _draw(self, address: str, number: int) -> None:
        """Do what a page does, until the service has gone."""
        with suppress(httpx.TransportError), httpx.Client(base_url=address, trust_env=False) as client:
            while True:
                time.sleep(0.02)
                frame = client.get("frame").json()
                shape = frame["height_px"], frame["width_px"]
                pixels = np.frombuffer(client.get(f"frames/{frame['id']}").content, np.uint8)
                if not frame["id"] or pixels.size != shape[0] * shape[1]:
                    continue
                self.shown[number] = pixels.reshape(shape)
                report = {"id": frame["id"], "digest": picture_digest(self.shown[number]), "reason": ""}
                size = {"width_px": shape[1], "height_px": shape[0], "device_pixel_ratio": 1.0}
                client.post("report", json=report | size)

    @contextmanager
    def speaks(self, view: int) -> Iterator[Projector]:
        yield self.twins[view]

    def __call__(self) -> np.ndarray:
        seen = np.full((144, 192), 0.02, np.float32)
        for number, picture in self.shown.items():
            if not self.twins[number].status().muted:
                small = cv2.resize(picture, (172, 108), interpolation=cv2.INTER_AREA)
                seen[18:126, 10:182] += small.astype(np.float32) * (0.4 / 255)
        return seen


def in_turn(folder: Path) -> Experiment:
    """A camera of the kernel that two projectors light in turn."""
    scene = two_walls()
    first, light = scene.views[0], scene.light
    assert isinstance(light, ProjectedPattern)
    aside_m = (light.projector.position_m[0] + 0.5, *light.projector.position_m[1:])
    own = dataclasses.replace(
        light,
        pattern=dataclasses.replace(light.pattern, seed=7),
        projector=dataclasses.replace(light.projector, position_m=aside_m),
    )
    second = dataclasses.replace(first, name="aside", light=own, camera_of="camera")
    kernel = V4l2CameraSettings(kind="v4l2", width_px=192, height_px=144, exposure_s=0.02)
    scene = dataclasses.replace(scene, views=(first, second))
    return create_experiment(folder, ExperimentSettings(rig=RigSettings(camera=kernel), scene=scene))


def test_projectors_of_one_wall_are_checked_one_while_the_other_is_dark(tmp_path, monkeypatch):
    wall = Wall()
    experiment = in_turn(tmp_path / "turns")
    monkeypatch.setattr(
        "app.rig.open.open_real", lambda settings: SimulatedCamera(wall, seed=1, name="of the kernel")
    )
    lamps = Lamps(experiment, wall.speaks)
    found = list(check_projectors(experiment, "kiosk", 0, wall.say, lamps=lamps))
    assert [name for name, _ in found] == ["camera", "aside"]
    assert [isinstance(one, Verdict) and one.good for _, one in found] == [True, True], found
    for page in wall.pages:
        page.join()
    # Each shows its own pattern when it is over.
    assert np.corrcoef(wall.shown[0].ravel(), wall.shown[1].ravel())[0, 1] < 0.5
