"""Two real cameras at once, one pulled out in the middle: by the kernel's virtual ones (tests/hardware/README.md)."""

import contextlib
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.errors import BadInputError
from app.experiment.capture_parts import parts_of
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment
from app.files.provenance import sha256
from app.files.toml import to_toml, toml_data
from app.setup.experiment import new_experiment, template
from drivers.v4l2 import list_devices
from drivers.v4l2.controls import Controls
from drivers.v4l2.node import Node

VIRTUAL = [one.path for one in list_devices() if one.driver == "vivid"]
pytestmark = pytest.mark.skipif(
    len(VIRTUAL) < 2, reason="needs two virtual cameras of the kernel (modprobe vivid n_devs=2)"
)
NAMES = ("camera", "right")
FRAMES = 100


@pytest.fixture
def experiment(tmp_path: Path) -> Experiment:
    sensor = {"kind": "v4l2", "pixel_format": "GREY", "bits": 8, "width_px": 320, "height_px": 180}
    lens = {"distance": "3 m", "angle_of_view": "50 deg"}
    answers = toml_data(template("wall-jet"), "answers")
    answers["camera"] = sensor | lens | {"device": str(VIRTUAL[0])}
    answers["view"] = [sensor | lens | {"device": str(VIRTUAL[1]), "name": NAMES[1], "wall": "x_max"}]
    return new_experiment(tmp_path / "lab", to_toml(answers), "answers")


def airlens(*words: str) -> subprocess.Popen[str]:
    """The command as an operator gives it, in a process of its own."""
    command = [sys.executable, "-c", "from app.cli import main; main()", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def pull_out(device: Path) -> None:
    """What an unplugged cable does: every call on the device fails from now on, until nobody has it open any more."""
    with contextlib.closing(Node(device)) as node:
        Controls(node).press("disconnect")


@pytest.mark.timeout(900)
@pytest.mark.parametrize("pulled", [0, 1])
def test_of_two_cameras_at_once_one_that_is_pulled_out_is_named_and_taken_again_alone(experiment, pulled):
    folder = str(experiment.folder)
    told = ["--frames", str(FRAMES), "--settle-frames", "4", "--max-refused", "10000"]
    capturing = airlens("capture", "reference", folder, *told, "--at-once")
    # Written with the first frame that is kept.
    while not list(experiment.captures_folder.glob("*/partial.tif")):
        assert capturing.poll() is None, capturing.communicate()[0]
        time.sleep(0.02)
    pull_out(VIRTUAL[pulled])
    said = " ".join(capturing.communicate(timeout=300)[0].split())

    assert capturing.returncode == 1
    assert f"lacks the pictures of {NAMES[pulled]!r}. {NAMES[pulled]}: device lost after" in said
    assert f"--view {NAMES[pulled]} takes that camera's alone" in said
    with pytest.raises(BadInputError, match="no finished reference"):
        experiment.latest_capture("reference")
    (kept,) = experiment.captures_folder.iterdir()
    parts = parts_of(kept, NAMES)
    assert parts.missing == (NAMES[pulled],)
    assert parts.views[1 - pulled]["frames"] == FRAMES
    picture = kept / parts.views[1 - pulled]["file"]
    before = sha256(picture)

    # Plugged in again it is taken alone, by the command that was named.
    again = airlens("capture", "retake", folder, "--view", NAMES[pulled])
    said = again.communicate(timeout=300)[0]
    assert again.returncode == 0, said
    assert experiment.latest_capture("reference") == kept
    capture = load_capture(kept)
    assert [image.frames for image in capture.images] == [FRAMES, FRAMES]
    assert sha256(picture) == before
    assert all(image.mean.std() > 0.1 for image in capture.images)
