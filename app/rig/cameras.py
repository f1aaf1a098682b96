"""Real cameras from the `[rig]` table."""

from pathlib import Path

from app.experiment.rig_settings import AravisCameraSettings, RealCameraSettings
from drivers.aravis import AravisCamera, AravisRequest
from drivers.protocols import Camera
from drivers.v4l2 import V4l2Camera, V4l2Request


def open_real(settings: RealCameraSettings) -> Camera:
    """Open the camera as the settings say. Raises DeviceError when it is away, in use, or grants less."""
    content = settings.model_dump(exclude={"kind", "device"})
    if isinstance(settings, AravisCameraSettings):
        return AravisCamera(AravisRequest(settings.device, **content))
    return V4l2Camera(V4l2Request(Path(settings.device), **content))
