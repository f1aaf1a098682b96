import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scipy import ndimage
from typer.testing import CliRunner

from app.cli import create_cli
from calibration.bundle import from_json


def run(*arguments: object):
    return CliRunner().invoke(create_cli(), ["calibrate", *map(str, arguments)])


def write_burst(folder: Path, electrons: float, rng: np.random.Generator) -> None:
    """Four 10-bit frames: 0.1 counts an electron, 6 e- read noise, dark level 16."""
    folder.mkdir(parents=True)
    for number in range(4):
        total = rng.poisson(electrons, (160, 200)) + rng.normal(0, 6, (160, 200))
        frame = np.clip(np.rint(total * 0.1 + 16), 0, 1023).astype(np.uint16)
        tifffile.imwrite(folder / f"{number}.tif", frame)


def test_a_response_folder_becomes_the_noise_model_of_the_bundle(tmp_path):
    rng = np.random.default_rng(1)
    write_burst(tmp_path / "images" / "dark", 0, rng)
    for level in (0, 64, 128, 192, 255):
        write_burst(tmp_path / "images" / f"grey_{level}", 9000 * (level / 255) ** 2.2, rng)

    done = run("response", tmp_path / "experiment", "--images", tmp_path / "images", "--bits", 10, "--json")

    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["projector"]["gamma"] == pytest.approx(2.2, rel=0.01)
    folder = tmp_path / "experiment" / "calibration"
    response = from_json((folder / "bundle.json").read_text()).response("camera")
    assert response is not None
    assert response.gain_counts_per_e == pytest.approx(0.1, rel=0.02)
    assert response.flat_field is not None
    assert tifffile.imread(folder / response.flat_field).shape == (160, 200)


def test_a_response_without_dark_frames_is_explained(tmp_path):
    write_burst(tmp_path / "grey_10", 100, np.random.default_rng(1))
    done = run("response", tmp_path, "--images", tmp_path, "--bits", 10)
    assert "no subfolder 'dark'" in str(done.exception)


def test_drift_between_two_files(tmp_path):
    rng = np.random.default_rng(2)
    picture = ndimage.gaussian_filter(rng.standard_normal((200, 240)), 1.5)
    picture = 500 + 200 * picture / picture.std() / 2
    moved = ndimage.shift(picture, (0.1, -0.2), order=5, mode="mirror")
    for name, image in (("before", picture), ("after", moved)):
        tifffile.imwrite(tmp_path / f"{name}.tif", np.rint(image * 40).astype(np.uint16))

    done = run("drift", tmp_path / "before.tif", tmp_path / "after.tif", "--border", 40, "--json")

    assert done.exit_code == 0, done.output
    np.testing.assert_allclose(json.loads(done.stdout)["total"]["shift_px"], [-0.2, 0.1], atol=0.01)
