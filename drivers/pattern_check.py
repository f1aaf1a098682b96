"""Before a burst: identify the screen, show the pattern, and let the camera say whether it sees it."""

from drivers.display import PatternDisplay, Picture
from drivers.identify import identify_frame, judge_seen, locate
from drivers.protocols import Camera, Pixels
from drivers.verdict import Verdict

SETTLE_FRAMES = 4


def check_pattern(display: PatternDisplay, camera: Camera, picture: Picture) -> Verdict:
    """Return the verdict on whether the camera sees `picture`, which stays on screen.

    Raises DeviceSettingError when the identify frame is not seen or the size is wrong; DeviceError.
    """
    rows, cols = picture.shape
    display.show(identify_frame(rows, cols))
    camera_from_picture = locate(_settled(camera), rows, cols)
    display.show(picture)
    return judge_seen(_settled(camera), picture, camera_from_picture)


def _settled(camera: Camera) -> Pixels:
    """Return a frame that was exposed when the screen had had time to change."""
    for _ in range(SETTLE_FRAMES):
        camera.grab()
    return camera.grab().pixels
