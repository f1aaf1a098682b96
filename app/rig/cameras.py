"""Real cameras from the `[rig]` table."""

from pathlib import Path

from app.experiment.rig_settings import V4l2CameraSettings
from drivers.v4l2 import V4l2Camera, V4l2Request


def open_v4l2(settings: V4l2CameraSettings) -> V4l2Camera:
    """Open the camera as the settings say. Raises DeviceError when it is away, in use, or grants less."""
    content = settings.model_dump(exclude={"kind", "device"})
    return V4l2Camera(V4l2Request(Path(settings.device), **content))
