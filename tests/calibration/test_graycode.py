import cv2
import numpy as np
import pytest

from calibration.errors import ImageError
from calibration.graycode import decode, frame_count, patterns
from calibration.local import on_panel
from calibration.sequence import resampling_issue, sequence_issues
from calibration.stripes import stripe_edges
from tests.calibration.practice import exposed

PANEL = (160, 100)


def test_the_order_is_opencv_s():
    # Seen by a camera that is the panel itself; OpenCV generates the code, we decode it.
    code = cv2.structured_light.GrayCodePattern.create(*PANEL).generate()[1]
    white = np.full((1, PANEL[1], PANEL[0]), 255, np.uint8)
    frames = np.concatenate([np.stack(code), white, white * 0])

    np.testing.assert_array_equal(frames, patterns(*PANEL))
    decoded = decode(frames, *PANEL)

    np.testing.assert_array_equal(decoded.column_px, np.broadcast_to(np.arange(160), (100, 160)))
    np.testing.assert_array_equal(decoded.row_px, np.broadcast_to(np.arange(100)[:, None], (100, 160)))
    assert decoded.lit.all()
    assert decoded.confidence.min() == 1.0


def seen_through(matrix: np.ndarray, size: tuple[int, int], shown: np.ndarray, seed: int = 0) -> np.ndarray:
    """The panel's pictures through a homography, on a half dark board, with a 10-bit camera's noise."""
    rng = np.random.default_rng(seed)
    paint = np.kron(np.indices((6, 8)).sum(0) % 2, np.ones((50, 60))) * 0.8 + 0.1
    frames = [
        cv2.warpPerspective(p, matrix, size, flags=cv2.INTER_LINEAR).astype(np.float32) / 255 for p in shown
    ]
    return np.stack([exposed(f * paint[: size[1], : size[0]] + 0.01, rng) for f in frames])


CAMERA_FROM_PANEL = np.array([[2.1, 0.15, 20.0], [-0.1, 2.3, 30.0], [2e-4, 1e-4, 1.0]])
SIZE = (400, 300)


def test_camera_positions_are_carried_to_the_panel_to_a_few_hundredths_of_a_pixel():
    frames = seen_through(CAMERA_FROM_PANEL, SIZE, patterns(*PANEL))
    decoded = decode(frames, *PANEL)
    rng = np.random.default_rng(1)
    panel = rng.uniform((20, 20), (140, 80), (30, 2))
    camera = cv2.perspectiveTransform(panel[None], CAMERA_FROM_PANEL)[0]

    places, good, rms = on_panel(decoded, stripe_edges(frames, decoded, *PANEL), camera, 14)

    assert good.mean() > 0.9
    error = np.linalg.norm(places - panel, axis=1)[good]
    # The code alone is rounded to whole pixels (0.41 px rms in two coordinates).
    assert np.sqrt(np.mean(error**2)) < 0.06
    assert np.median(rms) < 0.08
    assert sequence_issues("sound", frames, decoded, 1023) == ()


def test_confidence_is_low_on_edges_and_zero_without_light():
    frames = seen_through(CAMERA_FROM_PANEL, SIZE, patterns(*PANEL))
    decoded = decode(frames, *PANEL)

    assert decoded.confidence[:8].max() == 0.0
    inside = decoded.confidence[decoded.lit]
    assert inside.min() < 0.1
    assert inside.max() > 0.5


def test_swapped_frames_reversed_white_and_saturation_are_named():
    frames = seen_through(CAMERA_FROM_PANEL, SIZE, patterns(*PANEL))
    decoded = decode(frames, *PANEL)
    swapped = frames.copy()
    swapped[[1, 6]] = swapped[[6, 1]]
    reversed_white = frames.copy()
    reversed_white[[-1, -2]] = reversed_white[[-2, -1]]

    issues = sequence_issues("s", swapped, decode(swapped, *PANEL), 1023)
    assert "frames 0 and 1, 6 and 7 are no pattern and its inverse" in issues[0]
    issues = sequence_issues("s", reversed_white, decode(reversed_white, *PANEL), 1023)
    assert "expected white, then black" in issues[0]
    assert any("saturated" in i for i in sequence_issues("s", frames, decoded, 600))


@pytest.mark.parametrize("resize", [cv2.INTER_LINEAR, cv2.INTER_NEAREST], ids=["smooth", "nearest"])
def test_a_projector_that_scales_is_found_out(resize):
    native = patterns(*PANEL)
    shrunk = []
    for picture in native:
        small = cv2.resize(picture, None, fx=0.87, fy=0.87, interpolation=resize)
        # Grey pixels of the scaled picture go through the projector's gamma.
        shown = np.zeros_like(picture)
        shown[: small.shape[0], : small.shape[1]] = np.rint(255 * (small / 255.0) ** 2.2)
        shrunk.append(shown)

    def verdict(shown: np.ndarray) -> str | None:
        frames = seen_through(CAMERA_FROM_PANEL * np.array([[1.15], [1.15], [1.0]]), (450, 300), shown)
        decoded = decode(frames, *PANEL)
        edges = stripe_edges(frames, decoded, *PANEL)
        y, x = np.mgrid[80:240:20, 80:330:25]
        _, _, rms = on_panel(decoded, edges, np.stack([x.ravel(), y.ravel()], 1).astype(float), 14)
        return resampling_issue("s", frames, decoded, edges, float(np.median(rms)))

    assert verdict(native) is None
    found = verdict(np.stack(shrunk))
    assert found is not None
    assert "keystone" in found


def test_a_wrong_number_of_frames_is_refused_with_the_right_one():
    assert frame_count(1024, 768) == 42
    with pytest.raises(ImageError, match="needs 32"):
        decode(np.zeros((30, 8, 8), np.uint8), *PANEL)
