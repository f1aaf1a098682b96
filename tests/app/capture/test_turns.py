"""One camera under two projectors in turn, and a second camera with a projector of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.calibrate.parts import parts_of
from app.capture.burst import take
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import Experiment, open_experiment, save_settings
from app.experiment.rig_settings import V4l2CameraSettings
from app.pipeline import reconstruct
from app.rig.lamps import Lamps
from app.rig.open import named_camera, open_projector
from core.scene import FixedTexture, ProjectedPattern
from core.setting import SettingError
from drivers.burst import CapturePlan
from drivers.clock import SystemClock
from drivers.errors import DeviceError
from drivers.projector.protocol import Projector
from drivers.simulated import SimulatedCamera
from drivers.simulated.projector.open import open_twin
from tests.rooms import ROOM, state_grid

TINY = [
    "--information",
    "surveyed",
    "--camera-px",
    "128x96",
    "--frames",
    "2",
    "--world",
    "ideal",
    "--rig",
    "lab",
    "--border",
    "bare",
]


def simulated(folder: Path, *options: str) -> Path:
    told = ["simulate", str(folder), "--truth", str(ROOM), "--light", "projector", *TINY, *options]
    done = CliRunner().invoke(create_cli(), told, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return state_grid(folder, 8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two walls, a camera and a projector before each; a further projector lights the first one in turn."""
    return simulated(
        tmp_path_factory.mktemp("turns") / "room", "--views", "y,x", "--further-projector", "-1,-1"
    )


def test_every_view_has_its_own_projector_and_the_first_camera_a_second_one(folder):
    experiment = open_experiment(folder)
    first, aside, second = experiment.settings.scene.views
    assert second.camera_of == first.name
    assert second.camera == first.camera
    # A lab's projector stands 1 m beside its camera and 1 m above it; to the right of who looks at x_max is -y.
    for view, apart_m in ((aside, (0.0, -1.0, 1.0)), (second, (-1.0, 0.0, -1.0))):
        assert isinstance(view.light, ProjectedPattern)
        off_m = np.subtract(view.light.projector.position_m, view.camera.position_m)
        np.testing.assert_allclose(off_m, apart_m, atol=1e-9)
    pictures = [image.mean.ravel() for image in newest_pair(experiment).reference.images]
    assert np.abs(np.corrcoef(pictures)[np.triu_indices(3, 1)]).max() < 0.9
    assert [len(part.lacking) for part in parts_of(experiment)] == [0, 0, 0, 0]


def test_draft_uses_what_every_projector_shows(folder):
    done = reconstruct(folder, "draft")
    assert [shift is not None for shift in done.problem.shifts] == [True, True, True]
    assert len(done.finding.manifest["windows"]) == 3
    assert {"shift-0.nc", "shift-1.nc", "shift-2.nc"} <= {path.name for path in done.folder.iterdir()}
    report = (done.folder / "report.html").read_text()
    assert "camera at x_max" in report
    assert "camera, light 2" in report
    assert np.isfinite(done.solution.temperature_k).all()


class Room:
    """A camera of the kernel before a wall that two projectors light: what it sees is what is not muted."""

    def __init__(self, experiment: Experiment, lit: tuple[int, ...] = (0, 1)) -> None:
        self.twins = [open_twin("pjlink", SystemClock(), 0.0, 0.0) for _ in range(2)]
        for number in lit:
            self.twins[number].turn_on()
            self.twins[number].power()
        self.lamps = Lamps(experiment, self.speaks)
        self.asked: list[int] = []

    @contextmanager
    def speaks(self, view: int) -> Iterator[Projector]:
        self.asked.append(view)
        yield self.twins[view]

    def __call__(self) -> np.ndarray:
        lit = [0.2 * (n + 1) * (not twin.status().muted) for n, twin in enumerate(self.twins)]
        return np.full((96, 128), sum(lit), np.float32)

    def camera(self) -> SimulatedCamera:
        return SimulatedCamera(self, seed=1, name="of the kernel")


@pytest.fixture
def real(folder, tmp_path) -> Experiment:
    """The first camera's two views on a rig that is no simulation."""
    made = open_experiment(folder)
    first, _, second = made.settings.scene.views
    scene = replace(made.settings.scene, views=(first, second))
    kernel = V4l2CameraSettings(kind="v4l2", width_px=128, height_px=96, exposure_s=0.02)
    rig = made.settings.rig.model_copy(update={"camera": kernel})
    (tmp_path / "real").mkdir()
    return save_settings(tmp_path / "real", made.settings.model_copy(update={"rig": rig, "scene": scene}))


def test_all_projectors_are_dark_but_the_one_whose_turn_it_is(real):
    room = Room(real)
    with room.camera() as camera:
        taken = take(camera, real, CapturePlan(frames=2), lamps=room.lamps)
    assert taken.folder is not None
    assert taken.shortfall == ""
    levels = [float(image.mean.mean()) for image in load_capture(taken.folder).images]
    np.testing.assert_allclose(levels, [0.2, 0.4], atol=0.03)
    assert named_camera(real, 1) == real.settings.rig.camera


def test_another_camera_of_the_wall_sees_by_the_first_projector_alone(real):
    scene = real.settings.scene
    beside = replace(scene, views=(*scene.views, replace(scene.views[0], name="beside")))
    rig = real.settings.rig.model_copy(update={"cameras": {"beside": real.settings.rig.camera}})
    experiment = save_settings(real.folder, real.settings.model_copy(update={"rig": rig, "scene": beside}))
    room = Room(experiment)
    with room.camera() as camera:
        taken = take(
            camera, experiment, CapturePlan(frames=2), opens=lambda view: room.camera(), lamps=room.lamps
        )
    assert taken.folder is not None
    levels = [float(image.mean.mean()) for image in load_capture(taken.folder).images]
    np.testing.assert_allclose(levels, [0.2, 0.4, 0.2], atol=0.03)
    assert set(room.asked) == {0, 1}


def test_a_projector_that_is_not_there_or_does_not_obey_is_named(real):
    with Room(real).camera() as camera, pytest.raises(BadInputError, match="that is in turn, not at once"):
        take(camera, real, CapturePlan(frames=2), at_once=True)
    with pytest.raises(BadInputError, match=r"names no projector for 'camera, light 2'.*\[rig.projectors"):
        open_projector(real, 1)
    with pytest.raises(DeviceError, match="busy switching; wait a minute"):
        Room(real, lit=(0,)).lamps.light(0)


def test_what_cannot_be_lit_in_turn_is_refused_where_it_is_stated(folder):
    scene = open_experiment(folder).settings.scene
    first, _, second = scene.views
    with pytest.raises(SettingError, match="expected a view that has a camera of its own: 'camera'"):
        replace(scene, views=(first, replace(second, camera_of="nobody")))
    with pytest.raises(SettingError, match="a print on the wall cannot be switched off"):
        replace(scene, light=FixedTexture())
    with pytest.raises(BadInputError, match="expected metres across and up"):
        simulated(folder.parent / "wrong", "--further-projector", "left")
