"""Pictures of another camera: mean, scatter and count as of a capture; what cannot be is said before anything."""

import struct
import sys

import cv2
import numpy as np
import pytest
import tifffile

from app.capture.files import PictureFiles
from app.capture.imported import import_pictures
from app.capture.mosaic import judge_mosaic
from app.errors import BadInputError
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import ExperimentSettings, create_experiment
from app.files.image_folder import read_grey
from app.files.uploads.decode import decode
from app.reconstruct.measure import measure
from core.camera_noise import frame_variance, scattered_variance
from core.scene import CameraNoise, FixedTexture, Scene, SolveModel, View
from drivers.burst import CaptureRole
from drivers.shift import shift_image
from drivers.simulated import SensorNoise, SimulatedCamera
from tests.app.reconstruct.test_problem import CAMERA, ROOM
from tests.drivers.scenes import pattern

FRAMES, MOVED_PX = 20, 0.3


@pytest.fixture
def experiment(tmp_path):
    scene = Scene(
        room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), solve=SolveModel(window_px=16)
    )
    return create_experiment(tmp_path / "e", ExperimentSettings(scene=scene))


def frames(seed=1, moved=False, bits=16):
    """Frames of the pattern in 16 bits, or in 8."""
    picture = pattern()
    if moved:
        # Its middle to the right; the border is still.
        picture[24:72, 40:88] = shift_image(picture, (MOVED_PX, 0.0))[24:72, 40:88]
    camera = SimulatedCamera(lambda: picture, seed=seed, noise=SensorNoise(10_000.0, 3.0, 64.0, 12))
    taken = np.stack([camera.follow().pixels for _ in range(FRAMES)])
    return taken if bits == 16 else (taken >> 4).astype(np.uint8)


def written(folder, kind, **options):
    folder.mkdir()
    for n, pixels in enumerate(frames(bits=8 if kind == "jpg" else 16, **options)):
        if kind == "tif":
            tifffile.imwrite(folder / f"{n:02}.tif", pixels)
        else:
            cv2.imwrite(str(folder / f"{n:02}.{kind}"), pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])
    return str(folder)


@pytest.mark.parametrize("kind", ["tif", "png", "pages"])
def test_mean_scatter_and_count_are_those_of_the_frames(experiment, tmp_path, kind):
    taken = frames()
    if kind == "pages":
        tifffile.imwrite(tmp_path / "all.tif", taken)
        name = str(tmp_path / "all.tif")
    else:
        name = written(tmp_path / "r", kind) + f"/*.{kind}"
    (one,) = import_pictures(experiment, {"reference": [name]}, bits=12)
    assert one.folder is not None
    capture = load_capture(one.folder)
    assert capture.complete
    assert capture.images[0].frames == FRAMES
    np.testing.assert_allclose(capture.images[0].mean, taken.mean(0) / 4095, atol=1e-6)
    np.testing.assert_allclose(capture.images[0].std, taken.std(0, ddof=1) / 4095, atol=1e-6)
    assert capture.manifest["origin"]["rig"] == "imported"
    assert len(capture.manifest["origin"]["files"]) == (1 if kind == "pages" else FRAMES)


def dng(path, mosaic):
    """A raw file of a colour camera of 12 bits whose black is at 64 counts, red in the corner."""
    colours_of_xyz = (1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1)
    tags = [
        (33421, "H", 2, (2, 2), True),  # the mosaic's period, and its colours
        (33422, "B", 4, b"\x00\x01\x01\x02", True),
        (50706, "B", 4, b"\x01\x04\x00\x00", True),  # the format's version
        (50708, "s", 0, "a camera", True),
        (50714, "H", 1, 64, True),  # black
        (50717, "H", 1, 4095, True),  # white
        (50721, "2i", 9, colours_of_xyz, True),
    ]
    tifffile.imwrite(path, mosaic, photometric="cfa", extratags=tags)


def test_of_a_raw_file_the_green_is_taken_linear_from_black_to_white(experiment, tmp_path):
    taken = frames()
    for number, green in enumerate(taken):
        mosaic = green.copy()
        mosaic[::2, ::2] //= 3  # less red
        mosaic[1::2, 1::2] //= 2  # less blue
        dng(tmp_path / f"{number:02}.dng", np.maximum(mosaic, 64))
    (one,) = import_pictures(experiment, {"reference": [str(tmp_path / "*.dng")]})
    assert one.folder is not None
    capture = load_capture(one.folder)
    light = (np.maximum(taken, 64) - 64.0) / (4095 - 64)
    for rows, columns in ((slice(0, None, 2), slice(1, None, 2)), (slice(1, None, 2), slice(0, None, 2))):
        green = light[:, rows, columns]
        # One of 65,535 counts, rounded.
        np.testing.assert_allclose(capture.images[0].mean[rows, columns], green.mean(0), atol=2e-5)
        np.testing.assert_allclose(capture.images[0].std[rows, columns], green.std(0, ddof=1), atol=2e-5)


@pytest.mark.parametrize("colours", [(1.0, 1.0, 1.0, 1.0), (0.6, 1.0, 1.0, 0.5), (0.95, 1.0, 1.0, 1.0)])
def test_a_raw_mosaic_is_told_from_a_grey_picture(experiment, tmp_path, colours):
    for number, pixels in enumerate(frames()):
        mosaic = pixels.astype(float)
        for kind, part in enumerate(colours):
            mosaic[kind // 2 :: 2, kind % 2 :: 2] *= part
        tifffile.imwrite(tmp_path / f"{number:02}.tif", np.rint(mosaic).astype(np.uint16))
    (one,) = import_pictures(experiment, {"reference": [str(tmp_path / "*.tif")]}, bits=12)
    told = [verdict for verdict in one.burst.verdicts if verdict.name == "mosaic"]
    assert bool(told) == (min(colours) < 1)
    if told:
        assert not told[0].good
        assert "one colour" in told[0].advice


@pytest.mark.parametrize("period_px", [2.1, 3, 4, 6, 8])
def test_a_pattern_of_few_pixels_a_period_is_no_mosaic(period_px):
    columns = np.arange(512) + 0.5
    picture = np.tile(0.5 + 0.2 * np.cos(2 * np.pi * columns / period_px), (384, 1)).astype(np.float32)
    assert not judge_mosaic(picture)
    assert not judge_mosaic(pattern(384, 512))


@pytest.mark.parametrize("turn", [1, 3, 6])
def test_a_picture_is_read_as_its_sensor_has_it_by_every_door(tmp_path, turn):
    file = tmp_path / "turned.jpg"
    jpeg = cv2.imencode(".jpg", np.tile(np.arange(0, 256, 2, dtype=np.uint8), (96, 1)))[1].tobytes()
    orientation = b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, turn, 0)
    exif = b"Exif\0\0" + orientation
    file.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:])
    with PictureFiles([file]) as pictures:
        imported = pictures.grab().pixels
    (page,) = decode("jpeg", file, tmp_path)
    assert imported.shape == (96, 128)
    assert np.all(np.diff(imported[0].astype(int)) >= 0)
    np.testing.assert_array_equal(read_grey(file), imported)
    np.testing.assert_array_equal(np.load(tmp_path / f"{page['name']}.npy"), imported)


def test_without_rawpy_a_raw_file_says_what_to_install(experiment, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rawpy", None)
    dng(tmp_path / "one.dng", frames()[0])
    with pytest.raises(BadInputError, match=r"airlens\[raw\]"):
        import_pictures(experiment, {"reference": [str(tmp_path / "one.dng")]})


def test_the_noise_comes_from_the_frames():
    # Twice the counts an electron, and a light that flickers by 1 %.
    noise = CameraNoise(full_well_e=5_000.0, read_noise_e=10.0)
    light = (1 + 0.01 * np.random.default_rng(5).standard_normal(FRAMES)).astype(np.float32)
    picture = pattern(400, 400, level=0.4, contrast=0.3)
    sensor = SensorNoise(5_000.0, 10.0, 64.0, 12)
    scenes = [part * picture for part in light]
    taken = [
        SimulatedCamera(lambda v=v: v, seed=n, noise=sensor).follow().pixels for n, v in enumerate(scenes)
    ]
    mean = (np.mean(taken, 0) / 4095).astype(np.float32)
    std = (np.std(taken, 0, ddof=1) / 4095).astype(np.float32)
    found = scattered_variance(mean, std, FRAMES, float(light.std(ddof=1)), 1 / 4095)
    lit = mean > 0.2
    np.testing.assert_allclose(found[lit], frame_variance(mean, noise)[lit], rtol=0.06)


def test_what_is_imported_is_measured_as_what_is_captured_and_a_jpeg_says_what_it_is(experiment, tmp_path):
    shifts = {}
    for kind in ("tif", "jpg"):
        names: dict[CaptureRole, list[str]] = {
            "reference": [written(tmp_path / f"{kind}-r", kind)],
            "flow": [written(tmp_path / f"{kind}-f", kind, seed=2, moved=True)],
        }
        taken = import_pictures(experiment, names, bits=12 if kind == "tif" else None)
        bad = {verdict.name for one in taken for verdict in one.burst.verdicts if not verdict.good}
        assert ("compression" in bad) == (kind == "jpg")
        shifts[kind] = measure(newest_pair(experiment), experiment.settings.scene).shifts[0]
    middle = np.all(np.abs(shifts["tif"].centres_px - [64, 48]) < 9, axis=1)
    assert shifts["tif"].displacement_px[middle, 0].mean() == pytest.approx(MOVED_PX, abs=0.02)
    assert shifts["jpg"].displacement_px[middle, 0].mean() == pytest.approx(MOVED_PX, abs=0.08)


@pytest.mark.parametrize("bits", [None, 12])
def test_counts_of_12_bits_in_files_of_16_ask_for_the_bits(experiment, tmp_path, bits):
    (one,) = import_pictures(experiment, {"reference": [written(tmp_path / "r", "tif")]}, bits)
    bad = {verdict.name: verdict for verdict in one.burst.verdicts if not verdict.good}
    assert ("bits" in bad) == ("level" in bad) == (bits is None)
    if bits is None:
        assert "--bits" in bad["bits"].advice


def test_pictures_of_8_and_of_16_bits_are_no_burst(tmp_path):
    shallow, deep = tmp_path / "shallow.tif", tmp_path / "deep.tif"
    tifffile.imwrite(shallow, np.zeros((96, 128), np.uint8))
    tifffile.imwrite(deep, np.zeros((96, 128), np.uint16))
    with PictureFiles([shallow, deep]) as pictures:
        pictures.grab()
        with pytest.raises(BadInputError, match=r"deep.tif has 16 bits a pixel, the first picture 8"):
            pictures.grab()


def test_what_cannot_be_is_said_before_anything_is_kept(experiment, tmp_path):
    good = written(tmp_path / "good", "png")
    small = tmp_path / "small"
    small.mkdir()
    cv2.imwrite(str(small / "1.png"), np.zeros((10, 10), np.uint8))
    broken = tmp_path / "broken.png"
    broken.write_bytes((tmp_path / "good" / "00.png").read_bytes()[:500])
    text = tmp_path / "notes.txt"
    text.write_text("no picture")
    floats = tmp_path / "float.tif"
    tifffile.imwrite(floats, np.zeros((96, 128)))
    (tmp_path / "raw.nef").write_bytes(b"II*\0")
    table: list[tuple[dict[CaptureRole, list[str]], int | None, str]] = [
        ({}, None, "No picture was given"),
        ({"reference": [str(tmp_path / "nothing*.png")]}, None, "There is no picture"),
        ({"reference": [str(text)]}, None, "no picture that can be read"),
        ({"reference": [str(broken)]}, None, "broken.png"),
        ({"reference": [str(floats)]}, None, "8 or 16 bits"),
        ({"reference": [good], "flow": [good]}, None, "named as reference and as flow"),
        ({"reference": [good, good]}, None, "named twice"),
        ({"reference": [good], "flow": [str(small)]}, None, "128 x 96 px"),
        ({"reference": [good]}, 8, "8 bits hold at most 255"),
        ({"reference": [str(tmp_path / "raw.nef")]}, None, "raw.nef cannot be read"),
    ]
    for names, bits, words in table:
        with pytest.raises(BadInputError, match=words):
            import_pictures(experiment, names, bits)
    assert not experiment.captures_folder.exists() or not list(experiment.captures_folder.iterdir())
