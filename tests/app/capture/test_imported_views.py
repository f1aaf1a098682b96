"""Pictures of two cameras, brought one camera at a time: a capture is whole when both are there."""

import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest
import tifffile

from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import finished, open_experiment
from app.pipeline import reconstruct
from app.volume.score import score_experiment
from tests.app.capture.test_views import run
from tests.rooms import ROOM

SECOND = "camera at x_max"
FULL, FRAMES, ELECTRONS = 65535, 4, 1e6


def written(parent: Path, image, seed: int) -> str:
    """Frames of a picture without noise, now with some, as files of 16 bits."""
    parent.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    for number in range(FRAMES):
        counts = FULL * rng.poisson(ELECTRONS * image.mean) / ELECTRONS
        tifffile.imwrite(parent / f"{number}.tif", np.rint(np.clip(counts, 0, FULL)).astype(np.uint16))
    return str(parent / "*.tif")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A room seen by two cameras that have no noise."""
    made = tmp_path_factory.mktemp("two") / "room"
    options = ("--views", "y,x", "--camera-px", 256, "--world", "ideal", "--noise-free")
    assert run("simulate", made, "--truth", ROOM, *options).exit_code == 0
    return made


@pytest.fixture(scope="module")
def files(folder, tmp_path_factory) -> dict[tuple[str, int], str]:
    parent, pair = tmp_path_factory.mktemp("files"), newest_pair(open_experiment(folder))
    return {
        (role, view): written(parent / f"{role}-{view}", image, view)
        for role, capture in (("reference", pair.reference), ("flow", pair.flow))
        for view, image in enumerate(capture.images)
    }


@pytest.fixture(scope="module")
def drafted(folder) -> Path:
    """The result of its own pictures."""
    return reconstruct(folder, "draft").folder


@pytest.fixture
def empty(folder, tmp_path) -> Path:
    """The same room, with no capture."""
    shutil.copytree(folder, tmp_path / "room", ignore=shutil.ignore_patterns("captures", "results"))
    return tmp_path / "room"


def test_a_report_says_whose_each_camera_s_shifts_and_motion_are(drafted):
    page = unescape((drafted / "report.html").read_text())
    for name, wall in (("camera", "y_max"), (SECOND, "x_max")):
        assert f"{name}: measured shift" in page
        assert f"View '{name}': " in page
        assert f"{name}: averaging" in page
        assert f"m, looks at {wall}" in page


def test_a_capture_waits_for_the_second_camera_and_both_give_the_temperature(folder, files, empty, drafted):
    own = score_experiment(folder, ROOM, drafted)["T"]["rms_K"]
    first = run(
        "import", empty, "--view", "camera", "--reference", files["reference", 0], "--flow", files["flow", 0]
    )
    assert first.exit_code == 0, first.output
    assert first.output.count(f"once the pictures of '{SECOND}' are there") == 2
    assert finished(empty / "captures") == []
    done = run(
        "import", empty, "--view", SECOND, "--flow", files["flow", 1], "--reference", files["reference", 1]
    )
    assert done.exit_code == 0, done.output
    assert "once the pictures" not in done.output
    assert len(finished(empty / "captures")) == 2
    capture = load_capture(open_experiment(empty).latest_capture("flow"))
    assert capture.complete
    assert [len(view["files"]) for view in capture.manifest["views"]] == [FRAMES, FRAMES]

    found = score_experiment(empty, ROOM, reconstruct(empty, "draft").folder)["T"]["rms_K"]
    # The same light, weighed by the noise that the files have: 0.72 and 0.82 K, most of it what two views cannot see.
    assert found == pytest.approx(own, abs=0.15)
    assert found < 1.0


def test_what_was_named_wrongly_is_said_and_replaced(files, empty):
    without = run("import", empty, "--reference", files["reference", 0])
    assert f"has 2 views: 'camera', '{SECOND}'. Say which one" in str(without.exception)
    unknown = run("import", empty, "--view", "left", "--reference", files["reference", 0])
    assert f"no view 'left'; its views are 'camera', '{SECOND}'" in str(unknown.exception)
    assert not list(empty.glob("captures/*/"))

    assert run("import", empty, "--view", "camera", "--reference", files["reference", 1]).exit_code == 0
    twice = run("import", empty, "--view", SECOND, "--reference", files["reference", 1])
    assert "was imported as the reference of 'camera' already" in str(twice.exception)
    assert run("import", empty, "--view", "camera", "--reference", files["reference", 0]).exit_code == 0
    assert run("import", empty, "--view", SECOND, "--reference", files["reference", 1]).exit_code == 0
    (whole,) = finished(empty / "captures")
    means = [image.mean for image in load_capture(whole).images]
    for view, mean in enumerate(means):
        pages = [
            tifffile.imread(path) for path in sorted(Path(files["reference", view]).parent.glob("*.tif"))
        ]
        np.testing.assert_allclose(mean, np.mean(pages, axis=0) / FULL, atol=1e-6)
