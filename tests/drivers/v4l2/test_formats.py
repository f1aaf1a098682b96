import cv2
import numpy as np
import pytest

from drivers.errors import DeviceSettingError, FrameError
from drivers.v4l2.formats import Geometry, pixel_format

ROWS, COLS = 4, 6


def padded(rows, stride):
    """Return bytes of rows that are padded to a stride, as some drivers do, with junk in the padding."""
    data = np.full((len(rows), stride), 0xEE, np.uint8)
    raw = rows.view(np.uint8).reshape(len(rows), -1)
    data[:, : raw.shape[1]] = raw
    return data.ravel()


@pytest.mark.parametrize(("code", "bits"), [("Y10", 10), ("Y12", 12), ("Y16", 16)])
def test_words_keep_every_bit_whatever_the_stride(code, bits):
    values = np.random.default_rng(0).integers(0, 2**bits, (ROWS, COLS), dtype=np.uint16)
    for stride in (2 * COLS, 2 * COLS + 20):
        decoded = pixel_format(code).decode(padded(values, stride), Geometry(ROWS, COLS, stride))
        assert decoded.dtype == np.uint16
        assert np.array_equal(decoded, values)
    assert pixel_format(code).bits == bits


def test_bytes_luminance_of_pairs_and_the_luminance_plane():
    values = np.random.default_rng(0).integers(0, 256, (ROWS, COLS), dtype=np.uint8)
    grey = pixel_format("GREY").decode(padded(values, COLS + 2), Geometry(ROWS, COLS, COLS + 2))
    pairs = np.stack([values, np.full_like(values, 128)], axis=-1).reshape(ROWS, 2 * COLS)
    luminance = pixel_format("YUYV").decode(padded(pairs, 2 * COLS), Geometry(ROWS, COLS, 2 * COLS))
    planes = np.concatenate([values.ravel(), np.full(ROWS * COLS // 2, 128, np.uint8)])
    first = pixel_format("NV12").decode(planes, Geometry(ROWS, COLS, COLS))
    for decoded in (grey, luminance, first):
        assert np.array_equal(decoded, values)


def test_jpeg_is_decoded_and_a_torn_one_refused():
    picture = np.full((32, 48), 90, np.uint8)
    _, data = cv2.imencode(".jpg", picture)
    geometry = Geometry(32, 48, 0)
    decoded = pixel_format("MJPG").decode(data.ravel(), geometry)
    assert np.abs(decoded.astype(int) - 90).max() <= 2
    with pytest.raises(FrameError, match="could not be decoded"):
        pixel_format("MJPG").decode(data.ravel()[:40], geometry)


def test_a_format_that_is_not_read_is_refused_with_the_known_ones():
    with pytest.raises(DeviceSettingError, match="GREY, Y10"):
        pixel_format("RG16")


def test_a_whole_frame_is_known_by_its_bytes():
    assert pixel_format("Y16").bytes_needed(Geometry(4, 6, 16)) == 64
    assert pixel_format("MJPG").bytes_needed(Geometry(4, 6, 0)) == 1
