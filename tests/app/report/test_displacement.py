import cv2
import numpy as np
import pytest
import tifffile
import xarray as xr
from scipy import ndimage

from app.errors import BadInputError
from app.files.pictures import read_picture
from app.report.displacement import shift_field, write_shift_field
from core.setting import SettingError


@pytest.fixture(scope="module")
def dots():
    rng = np.random.default_rng(0)
    image = ndimage.gaussian_filter(rng.standard_normal((200, 240)), 1.5)
    return (0.5 + 0.15 * image / image.std()).clip(0, 1).astype(np.float32)


def test_a_uniform_shift_is_found_within_its_stated_uncertainty(dots):
    rng = np.random.default_rng(1)
    noise = 0.01
    flow = ndimage.shift(dots, (-0.4, 0.7), order=5, mode="nearest")
    pair = [(i + noise * rng.standard_normal(i.shape)).astype(np.float32) for i in (dots, flow)]

    field = shift_field(*pair)

    inner = field.displacement_px[40:-40, 40:-40] - np.array([0.7, -0.4])
    assert np.sqrt(np.mean(inner**2)) < 0.05
    ratio = inner / field.std_px[40:-40, 40:-40]
    # Farneback's own smoothing differs from the stated window's: within a factor of two.
    assert 0.3 < np.sqrt(np.mean(ratio**2)) < 2.0


def test_drift_of_the_border_is_removed_and_reported(dots):
    flow = ndimage.shift(dots, (0.3, -0.5), order=5, mode="nearest")
    field = shift_field(dots, flow, remove_drift=True)
    assert field.drift_px[0] == pytest.approx(-0.5, abs=0.05)
    assert np.abs(np.median(field.displacement_px, axis=(0, 1))).max() < 0.05


def test_the_field_on_disk_has_units_and_both_uncertainties(dots, tmp_path):
    path = tmp_path / "shift.nc"
    write_shift_field(path, shift_field(dots, dots), "still")
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert set(data.data_vars) == {"dx", "dy", "dx_std", "dy_std"}
        assert data["dx"].attrs["units"] == "pixel"
        np.testing.assert_array_equal(data["dx"].to_numpy(), shift_field(dots, dots).displacement_px[..., 0])


@pytest.mark.parametrize("kind", ["u8.png", "u16.png", "u8.tif", "u16.tif"])
def test_pictures_of_8_and_16_bit_are_read_in_parts_of_full_scale(kind, tmp_path, dots):
    dtype = np.uint16 if "16" in kind else np.uint8
    counts = np.round(dots * np.iinfo(dtype).max).astype(dtype)
    path = tmp_path / kind
    if path.suffix == ".png":
        cv2.imwrite(str(path), counts)
    else:
        tifffile.imwrite(path, counts)
    np.testing.assert_allclose(read_picture(path), dots, atol=0.6 / np.iinfo(dtype).max)


def test_pictures_that_are_none_are_refused(tmp_path):
    path = tmp_path / "a.tif"
    path.write_bytes(b"II*\x00garbage")
    with pytest.raises(BadInputError, match="cannot be read"):
        read_picture(path)
    png = tmp_path / "a.png"
    png.write_bytes(b"\x89PNG")
    with pytest.raises(BadInputError, match="cannot be read"):
        read_picture(png)
    cv2.imwrite(str(png), np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(BadInputError, match="one channel"):
        read_picture(png)


def test_pictures_of_unequal_size_are_refused(dots):
    with pytest.raises(SettingError, match="equal sizes"):
        shift_field(dots, dots[:-1])


def test_a_picture_without_a_pattern_is_named(dots):
    black = np.zeros_like(dots)
    noisy = black + np.random.default_rng(2).normal(0.0, 0.002, dots.shape).astype(np.float32)
    for pair, name in (((dots, black), "flow"), ((noisy, dots), "reference"), ((black, black), "reference")):
        with pytest.raises(SettingError, match=f"The {name} picture shows no pattern"):
            shift_field(*pair)
    shift_field(dots, 0.3 * dots)
