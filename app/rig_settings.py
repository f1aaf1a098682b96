"""Which devices make up the rig: the `[rig]` table of experiment.toml."""

from typing import Annotated, Literal

from pydantic import Field

from app.configuration import Strict


class SimulatedCameraSettings(Strict):
    """A camera twin that looks at a room volume in the experiment folder."""

    kind: Literal["simulated"] = "simulated"
    room: str = "truth.npz"
    exposure_s: Annotated[float, Field(gt=0, le=60)] = 0.02
    seed: int = 0
    drift_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    noise_free: bool = False


class V4l2CameraSettings(Strict):
    """A camera that the kernel knows (Video for Linux)."""

    kind: Literal["v4l2"]
    device: str = "/dev/video0"
    pixel_format: str = "Y16"
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    bits: Annotated[int, Field(ge=1, le=16)] = 16
    exposure_s: Annotated[float, Field(gt=0, le=60)]
    gain: float | None = None


CameraSettings = Annotated[SimulatedCameraSettings | V4l2CameraSettings, Field(discriminator="kind")]


class ProjectorSettings(Strict):
    """How the projector is spoken to: `airlens projector` takes the same address; `simulated:` is a twin."""

    url: str


class RigSettings(Strict):
    """The devices of the rig."""

    camera: CameraSettings = SimulatedCameraSettings()
    projector: ProjectorSettings | None = None
