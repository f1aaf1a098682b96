"""Two of the kernel's virtual cameras taken at once by airlens' own commands, and pulled out in the middle (README).

Prints each command with what it says, and under it what was checked; ends at the first check that fails. The number
of frames may be given; a slow machine needs few.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from app.files.provenance import sha256
from app.files.toml import to_toml, toml_data
from app.setup.experiment import template
from drivers.v4l2 import list_devices
from drivers.v4l2.controls import Controls
from drivers.v4l2.node import Node

DEVICES = [one.path for one in list_devices() if one.driver == "vivid"][:2]
NAMES = ("camera", "right")
FRAMES = int(sys.argv[1]) if len(sys.argv) > 1 else 100
DRIVER = Path("/sys/bus/platform/drivers/vivid")


def begun(*words):
    print("\n$ airlens", *words, flush=True)
    command = [str(Path(sys.executable).with_name("airlens")), *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def ended(process, expected=0):
    said = process.communicate(timeout=900)[0]
    print(said.strip(), flush=True)
    assert process.returncode == expected, process.returncode
    return " ".join(said.split())


def airlens(*words, expected=0):
    return ended(begun(*words), expected)


def at_once(role, lab):
    return "capture", role, lab, "--frames", FRAMES, "--max-refused", 10000, "--at-once"


def found(**what):
    print("  #", json.dumps(what, default=str), flush=True)


@contextmanager
def pulled_out(number: int) -> Iterator[None]:
    """One of them is away: every call on it fails, and its node is gone, as with a cable that was pulled."""
    device = DEVICES[number]
    node_number = device.stat().st_rdev
    with closing(Node(device)) as node:
        Controls(node).press("disconnect")
        device.unlink()
        found(pulled_out=device)
        yield
    os.mknod(device, 0o20660, node_number)
    found(back=device)


def until_in_the_middle(process, lab, lasts_s):
    """Wait for half the time that the frames take; the first one that is kept is written at once."""
    before = set(lab.glob("captures/*/partial.tif"))
    while not set(lab.glob("captures/*/partial.tif")) - before:
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.02)
    time.sleep(lasts_s / 2)


def new_experiment(parent):
    sensor = {"kind": "v4l2", "pixel_format": "GREY", "bits": 8, "width_px": 320, "height_px": 180}
    lens = {"distance": "3 m", "angle_of_view": "50 deg"}
    answers = toml_data(template("wall-jet"), "answers")
    answers["camera"] = sensor | lens | {"device": str(DEVICES[0])}
    answers["view"] = [sensor | lens | {"device": str(DEVICES[1]), "name": NAMES[1], "wall": "x_max"}]
    (parent / "answers.toml").write_text(to_toml(answers))
    airlens("new", parent / "lab", "--from", parent / "answers.toml")
    return parent / "lab"


def captures(lab):
    return sorted((lab / "captures").iterdir())


def whole(folder):
    """What the manifest says of both views, and how long the frames of the first took."""
    manifest = json.loads((folder / "manifest.json").read_text())
    views = manifest["views"]
    assert [view["frames"] for view in views] == [FRAMES, FRAMES]
    found(
        capture=folder.name,
        files=[view["file"] for view in views],
        cameras=manifest["origin"].get("cameras"),
        verdicts=[{one["name"]: one["good"] for one in view["verdicts"]} for view in views],
    )
    times_s = [one["timestamp_s"] for one in views[0]["records"]]
    return manifest, times_s[-1] - times_s[0]


def takes_both_at_once(role, lab):
    airlens(*at_once(role, lab))
    manifest, lasts_s = whole(captures(lab)[-1])
    assert manifest["origin"]["cameras"]["at_once"]
    assert manifest["origin"]["cameras"]["apart_s"] < lasts_s
    return lasts_s


def one_is_pulled_out(role, lab, number, lasts_s):
    name = NAMES[number]
    capturing = begun(*at_once(role, lab))
    until_in_the_middle(capturing, lab, lasts_s)
    with pulled_out(number):
        said = ended(capturing, expected=1)
        assert f"lacks the pictures of {name!r}. {name}: device lost after" in said
        assert "Plug the camera in" in said
        assert f"--view {name} takes that camera's alone" in said
        assert f"{DEVICES[number]} is not there" in airlens("capture", "retake", lab, expected=1)
    folder = captures(lab)[-1]
    other = folder / (f"{role}.tif" if number else f"{role}-1.tif")
    before = sha256(other)
    found(capture=folder.name, holds=sorted(path.name for path in folder.iterdir()))
    airlens("capture", "retake", lab, "--view", name)
    whole(folder)
    assert sha256(other) == before


def both_are_pulled_out(role, lab, lasts_s):
    capturing = begun(*at_once(role, lab))
    until_in_the_middle(capturing, lab, lasts_s)
    (DRIVER / "unbind").write_text("vivid.0")
    try:
        assert not any(device.exists() for device in DEVICES)
        found(pulled_out=DEVICES)
        assert "No camera's picture is whole: take it again." in ended(capturing, expected=1)
    finally:
        (DRIVER / "bind").write_text("vivid.0")
        found(back=DEVICES)
    assert not (captures(lab)[-1] / "manifest.json").exists()


def main():
    if len(DEVICES) < 2:
        sys.exit("This needs two virtual cameras of the kernel: modprobe vivid n_devs=2, as the README says.")
    with tempfile.TemporaryDirectory() as parent:
        lab = new_experiment(Path(parent))
        lasts_s = takes_both_at_once("reference", lab)
        both_are_pulled_out("reference", lab, lasts_s)
        takes_both_at_once("reference", lab)
        takes_both_at_once("flow", lab)
        one_is_pulled_out("reference", lab, 1, lasts_s)
        one_is_pulled_out("flow", lab, 0, lasts_s)
        airlens("status", lab)
    print("\nAll as expected.")


main()
