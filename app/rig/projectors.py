"""Real projectors by their address, and where their lamp's times are kept: one journal for every program."""

import os
from pathlib import Path

from app.files.user_folders import state_folder
from drivers.projector.link import ProjectorLink
from drivers.projector.open import open_projector

PASSWORD = "AIRLENS_PROJECTOR_PASSWORD"


def open_real_projector(url: str) -> ProjectorLink:
    """Return the projector at `url`, as `escvp21:/dev/ttyUSB0`. Raises DeviceSettingError."""
    return open_projector(url, password=os.environ.get(PASSWORD, ""), journal=lamp_journal(url))


def lamp_journal(url: str) -> Path:
    """Return the file that remembers when this projector's lamp was lit and put out."""
    name = "".join(c if c.isalnum() else "-" for c in url)
    return state_folder() / f"lamp-{name}.json"
