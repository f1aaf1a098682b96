"""Is what the camera sees what was sent? A frame that names its corners, and a comparison through them."""

import cv2
import numpy as np
from jaxtyping import Float64

from drivers.display import Picture
from drivers.errors import DeviceSettingError
from drivers.protocols import Pixels
from drivers.verdict import Verdict

_DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
MIN_CORRELATION = 0.8


def identify_frame(rows: int, cols: int, name: str = "") -> Picture:
    """Return a picture with a marker in each corner, a border one pixel wide, its own size in words, and a name.

    Raises DeviceSettingError for a size that has no room for the markers.
    """
    side = min(rows, cols) // 5
    if side < 24:
        raise DeviceSettingError(f"{cols} x {rows} is too small to identify; expected at least 120 px.")
    frame = np.full((rows, cols), 200, np.uint8)
    for number, (row, col) in enumerate(_corners(rows, cols, side)):
        marker = cv2.aruco.generateImageMarker(_DICTIONARY, number, side)
        frame[row : row + side, col : col + side] = marker
    frame[[0, -1], :] = 255
    frame[:, [0, -1]] = 255
    _write(frame, f"{cols} x {rows}", rows // 2)
    _write(frame, name, 5 * rows // 8)
    return frame


def locate(seen: Pixels, rows: int, cols: int) -> Float64[np.ndarray, "3 3"]:
    """Return the homography from picture to camera pixels, from an identify frame as the camera sees it.

    Raises DeviceSettingError that says which corners are missing.
    """
    low, high = np.percentile(seen[::4, ::4], (1, 99))  # hot pixels outshine any picture
    grey = np.clip((seen - low) * (255.0 / max(high - low, 1.0)), 0, 255).astype(np.uint8)
    corners, ids, _ = cv2.aruco.ArucoDetector(_DICTIONARY).detectMarkers(grey)
    found = {
        int(i): c.reshape(4, 2) for i, c in zip(np.ravel([] if ids is None else ids), corners, strict=True)
    }
    names = ("top left", "top right", "bottom left", "bottom right")
    missing = [name for number, name in enumerate(names) if number not in found]
    if missing:
        raise DeviceSettingError(
            f"The camera does not see the identify frame's {', '.join(missing)} corner. "
            "Check that the pattern "
            "is on the projector and no other screen, is not mirrored, and is in view."
        )
    side = min(rows, cols) // 5
    square = np.array([[0, 0], [side - 1, 0], [side - 1, side - 1], [0, side - 1]], float)
    sent = [square + np.array([col, row]) for row, col in _corners(rows, cols, side)]
    homography, _ = cv2.findHomography(np.concatenate(sent), np.concatenate([found[n] for n in range(4)]))
    return np.asarray(homography, np.float64)


def judge_seen(seen: Pixels, sent: Picture, camera_from_picture: Float64[np.ndarray, "3 3"]) -> Verdict:
    """Return the verdict on whether the camera sees the picture that was sent: correlation where both are."""
    size = (seen.shape[1], seen.shape[0])
    expected = cv2.warpPerspective(sent.astype(np.float32), camera_from_picture, size)
    inside = cv2.warpPerspective(np.ones(sent.shape, np.uint8), camera_from_picture, size) > 0
    a, b = expected[inside].astype(float), seen[inside].astype(float)
    constant = a.size < 100 or a.std() == 0 or b.std() == 0
    correlation = 0.0 if constant else float(np.corrcoef(a, b)[0, 1])
    return Verdict(
        "seen is sent",
        correlation >= MIN_CORRELATION,
        correlation,
        f"correlation of at least {MIN_CORRELATION:g} with the picture that was sent",
        "Check focus and light, that the right picture is shown, and that nothing stands in the way.",
    )


def _write(frame: Picture, text: str, row: int) -> None:
    """Write a line in the middle of the picture, its centre at a row; smaller where it is too long."""
    rows, cols = frame.shape
    scale = min(rows, cols) / 300
    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 2)
    scale *= min(1.0, 0.9 * cols / max(width, 1))
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 2)
    at = ((cols - width) // 2, row + height // 2)
    cv2.putText(frame, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 0, 2)


def _corners(rows: int, cols: int, side: int) -> list[tuple[int, int]]:
    margin = side // 4
    far_row, far_col = rows - margin - side, cols - margin - side
    return [(margin, margin), (margin, far_col), (far_row, margin), (far_row, far_col)]
