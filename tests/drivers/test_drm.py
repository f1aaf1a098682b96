from pathlib import Path

import pytest

from drivers.display import PatternDisplay
from drivers.drm import DrmDisplay
from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError


def test_a_card_that_is_not_there_is_said(tmp_path):
    with pytest.raises(DeviceNotFoundError, match="Name another card"):
        DrmDisplay(tmp_path / "card9")


def test_what_is_no_card_is_refused_and_freed(tmp_path):
    # Any other file knows none of the requests.
    path = tmp_path / "file"
    path.write_bytes(b"")
    with pytest.raises((DeviceError, OSError)):
        DrmDisplay(path)


@pytest.mark.hardware
def test_a_real_card_is_a_display():
    card = Path("/dev/dri/card0")
    if not card.exists():
        pytest.skip("no graphics card here")
    try:
        display = DrmDisplay(card)
    except DeviceBusyError as error:
        pytest.skip(str(error))
    with display:
        assert isinstance(display, PatternDisplay)
        assert min(display.size) > 0
