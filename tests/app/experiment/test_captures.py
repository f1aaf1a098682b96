import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.errors import AirlensError, BadInputError
from app.experiment.capture_files import BurstImage, read_image, read_raw_stack, write_image
from app.experiment.captures import load_capture, write_capture
from app.experiment.recorder import CaptureRecorder
from app.files.disk_space import check_room
from app.files.provenance import sha256
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.protocols import CameraInfo
from drivers.simulated import CameraFault, SimulatedCamera
from tests.drivers.scenes import pattern


def make_camera(**options):
    view = pattern()
    return SimulatedCamera(lambda: view, seed=5, **options)


def test_a_capture_comes_back_with_its_metadata(tmp_path):
    burst = run_capture(make_camera(), CapturePlan(role="flow", frames=6, exposure_s=0.01))
    folder = write_capture(tmp_path / "one", burst, origin={"seed": 5})

    capture = load_capture(folder)

    assert capture.complete
    assert capture.role == "flow"
    assert np.array_equal(capture.images[0].mean, burst.mean)
    assert np.array_equal(capture.images[0].std, burst.std)
    view = capture.manifest["views"][0]
    assert [r["sequence"] for r in view["records"]] == [r.sequence for r in burst.records]
    assert view["settings"][0] == {"name": "exposure_s", "asked": 0.01, "granted": 0.01}
    assert capture.manifest["origin"] == {"seed": 5}
    assert not (folder / "incomplete.json").exists()


def test_two_views_are_two_images(tmp_path):
    bursts = [run_capture(make_camera(), CapturePlan(frames=2)) for _ in range(2)]
    capture = load_capture(write_capture(tmp_path / "two", bursts, role="reference"))
    assert len(capture.images) == 2
    assert (tmp_path / "two" / "reference-1.tif").exists()


def test_the_raw_stack_holds_every_frame_that_is_in_the_mean(tmp_path):
    plan = CapturePlan(frames=5, raw_stack=True)
    recorder = CaptureRecorder(tmp_path / "raw", plan)
    burst = run_capture(make_camera(), plan, on_frame=recorder.observe)
    recorder.keep(burst)

    frames, records = read_raw_stack(tmp_path / "raw" / "frames.tif")

    assert tuple(records) == burst.records
    np.testing.assert_allclose(np.mean(frames, 0) / burst.full_scale_counts, burst.mean, rtol=1e-6)


def test_a_lost_camera_leaves_a_readable_capture_that_is_no_measurement(tmp_path):
    plan = CapturePlan(frames=40)
    recorder = CaptureRecorder(tmp_path / "lost", plan)
    camera = make_camera(faults={20: CameraFault.UNPLUG}.get)
    recorder.keep(run_capture(camera, plan, on_frame=recorder.observe))

    capture = load_capture(tmp_path / "lost")

    assert not capture.complete
    assert 10 < capture.images[0].frames < 20
    assert json.loads((tmp_path / "lost" / "incomplete.json").read_text())["outcome"] == "device lost"
    assert not (tmp_path / "lost" / "manifest.json").exists()


def test_a_slow_disk_holds_up_no_frame_and_the_last_checkpoint_is_whole(tmp_path, monkeypatch):
    def slow(path, image):
        time.sleep(0.5)
        write_image(path, image)

    monkeypatch.setattr("app.experiment.recorder.write_image", slow)
    plan, waited_s = CapturePlan(frames=30), []
    recorder = CaptureRecorder(tmp_path / "slow", plan, checkpoint_s=0.0)

    def observe(taken):
        began_s = time.monotonic()
        recorder.observe(taken)
        waited_s.append(time.monotonic() - began_s)

    burst = run_capture(make_camera(), plan, on_frame=observe)
    assert max(waited_s) < 0.4
    recorder.leave()
    assert load_capture(tmp_path / "slow").images[0].frames == 1
    again = CaptureRecorder(tmp_path / "again", plan, checkpoint_s=0.0)
    run_capture(make_camera(), plan, on_frame=again.observe)
    again.keep(burst)
    assert load_capture(tmp_path / "again").complete
    gone = CaptureRecorder(tmp_path / "gone", plan, checkpoint_s=0.0)
    run_capture(make_camera(), plan, on_frame=gone.observe)
    gone.discard()
    assert not (tmp_path / "gone").exists()


def test_discard_leaves_nothing(tmp_path):
    plan = CapturePlan(raw_stack=True)
    recorder = CaptureRecorder(tmp_path / "gone", plan)
    run_capture(make_camera(), plan, on_frame=recorder.observe, abort=lambda: False)
    recorder.discard()
    assert not (tmp_path / "gone").exists()


KILLED = """
import sys
from pathlib import Path
from app.experiment.recorder import CaptureRecorder
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern

plan = CapturePlan(frames=100_000, raw_stack=sys.argv[2] == "raw")
view = pattern(512, 512)
recorder = CaptureRecorder(Path(sys.argv[1]), plan, checkpoint_s=0.02)
run_capture(SimulatedCamera(lambda: view, seed=1), plan, on_frame=recorder.observe)
"""


@pytest.mark.parametrize("stack", ["raw", "moments"])
def test_kill_9_in_the_middle_leaves_what_was_taken_marked_as_incomplete(tmp_path, stack):
    folder = tmp_path / "killed"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(folder), stack], cwd=Path(__file__).parents[3]
    )
    watched = folder / ("frames.tif" if stack == "raw" else "partial.tif")
    deadline_s = time.monotonic() + 200
    while not (watched.exists() and watched.stat().st_size > 1_000_000) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    time.sleep(0.2)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()

    capture = load_capture(folder)

    assert not capture.complete
    assert capture.images[0].frames >= 1
    assert capture.images[0].mean.mean() == pytest.approx(0.507, abs=0.02)
    assert json.loads((folder / "incomplete.json").read_text())["role"] == "reference"
    if stack == "raw":
        frames, records = read_raw_stack(folder / "frames.tif")
        assert len(frames) >= 2
        assert [r.sequence for r in records] == list(range(records[0].sequence, records[-1].sequence + 1))
        assert all(frame.shape == (512, 512) and frame.min() > 0 for frame in frames)


def test_no_room_is_said_before_the_burst_begins(tmp_path):
    camera = CameraInfo("camera", 4096, 3072, 12, 30.0)
    check_room(tmp_path / "new", CapturePlan(frames=10), camera)
    with pytest.raises(AirlensError, match="GB on disk"):
        check_room(tmp_path / "new", CapturePlan(frames=10_000_000, raw_stack=True), camera)
    with pytest.raises(AirlensError, match="GB of memory"):
        check_room(tmp_path, CapturePlan(frames=1), CameraInfo("camera", 40_000, 25_000, 8, 1.0))


def test_what_is_no_capture_is_refused_with_the_reason(tmp_path):
    with pytest.raises(BadInputError, match=r"no manifest\.json"):
        load_capture(tmp_path)
    burst = run_capture(make_camera(), CapturePlan(frames=2))
    folder = write_capture(tmp_path / "cut", burst)
    (folder / "reference.tif").write_bytes((folder / "reference.tif").read_bytes()[:5000])
    with pytest.raises(BadInputError, match=r"reference\.tif is not the file that was kept"):
        load_capture(folder)
    (folder / "reference.tif").unlink()
    with pytest.raises(BadInputError, match=r"reference\.tif cannot be read .* take the capture again"):
        load_capture(folder)


def test_a_file_that_is_not_the_one_that_was_kept_is_refused_by_its_hash(tmp_path):
    burst = run_capture(make_camera(), CapturePlan(frames=2))
    folder = write_capture(tmp_path / "kept", burst)
    kept = load_capture(folder)
    for name, digest in kept.sha256.items():
        assert digest == sha256(folder / name)
    assert set(kept.sha256) == {"manifest.json", "reference.tif"}

    # A picture that can be read, and is not the one that was measured.
    image = read_image(folder / "reference.tif")
    write_image(folder / "reference.tif", BurstImage(image.mean * np.float32(0.5), image.std, image.frames))
    with pytest.raises(BadInputError, match=r"is not the file that was kept.*Restore the file"):
        load_capture(folder)

    other = write_capture(tmp_path / "other", burst)
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["views"][0]["sha256"] = "x"
    (other / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(BadInputError, match=r"reference\.tif is not the file that was kept.*says x\."):
        load_capture(other)


def test_a_file_with_its_hash_that_is_no_picture_is_refused(tmp_path):
    folder = write_capture(tmp_path / "text", run_capture(make_camera(), CapturePlan(frames=2)))
    (folder / "reference.tif").write_text("not a picture")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["views"][0]["sha256"] = sha256(folder / "reference.tif")
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(BadInputError, match=r"reference\.tif cannot be read .* A capture's image"):
        load_capture(folder)
