"""What is asked about a rig and a room; `app/setup/templates` shows it filled in.

The room's corner is the origin: x runs along the patterned wall to the right as the camera sees it, y from the
camera to the patterned wall, z upwards. An opening is a rectangle on a wall: `lower` and `upper` are its two
corners along the wall's two axes, in the order x, y, z.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from app.files.toml import Strict
from app.setup.units import Angle, Difference, Distance, Flow, Length, Share, Size, Speed, Temperature, Time
from core.geometry import WallName

Pixels = Annotated[int, Field(ge=16, le=20_000)]


class CameraAnswer(Strict):
    """The camera, its lens, and where it stands: `distance` from the patterned wall, else `position`.

    The lens is known by its angle of view across the picture, or by focal length and pixel pitch. It is what
    calibration starts from. A simulated camera looks at the room of `truth`, an NPZ file.
    """

    kind: Literal["v4l2", "simulated"]
    device: str = "/dev/video0"
    pixel_format: str = "Y16"
    bits: Annotated[int, Field(ge=1, le=16)] = 12
    width_px: Pixels
    height_px: Pixels
    exposure: Time = 0.02
    frames: Annotated[int, Field(ge=1, le=100_000)] = 100
    angle_of_view: Angle | None = None
    focal_length: Distance | None = None
    pixel_pitch: Distance | None = None
    distance: Distance | None = None
    position: tuple[Length, Length, Length] | None = None
    truth: str = ""

    @model_validator(mode="after")
    def _one_way(self) -> "CameraAnswer":
        lens = self.focal_length is not None and self.pixel_pitch is not None
        if lens == (self.angle_of_view is not None):
            raise ValueError("give angle_of_view, or focal_length and pixel_pitch, and not both")
        if (self.distance is None) == (self.position is None):
            raise ValueError("give distance (to the patterned wall) or position, and not both")
        if (self.kind == "simulated") != bool(self.truth):
            raise ValueError("give truth, the room that it looks at, for a simulated camera, and only there")
        return self


class ProjectorAnswer(Strict):
    """A projector instead of a print: where its lens is, its panel, and its address if it can be spoken to."""

    position: tuple[Length, Length, Length]
    width_px: Pixels
    height_px: Pixels
    angle_of_view: Angle
    url: str = ""


class Opening(Strict):
    """A rectangle on a wall."""

    wall: WallName
    lower: tuple[Length, Length]
    upper: tuple[Length, Length]


class SupplyAnswer(Opening):
    """Air that is blown in, straight off its wall: as volume flow, or as mean speed."""

    flow: Flow | None = None
    speed: Speed | None = None
    deviation: Share = 0.05
    temperature: Temperature
    temperature_deviation: Difference = 0.3

    @model_validator(mode="after")
    def _one_way(self) -> "SupplyAnswer":
        if (self.flow is None) == (self.speed is None):
            raise ValueError("give flow or speed, and not both")
        if self.speed is not None and self.speed <= 0:
            raise ValueError("speed is that of air coming in, above 0; where air leaves is an outlet")
        return self


class OutletAnswer(Opening):
    """Where air leaves; a thermometer in it fixes the level of every temperature."""

    temperature: Temperature | None = None
    temperature_deviation: Difference = 0.3


class SurfaceAnswer(Opening):
    """A radiator, a heated floor, a cooled ceiling, a cold window: its surface's temperature."""

    temperature: Temperature
    temperature_deviation: Difference = 0.5


class WallAnswer(Strict):
    """A whole wall: its surface's temperature, or `adiabatic = true` for one that passes no heat."""

    wall: WallName
    temperature: Temperature | None = None
    temperature_deviation: Difference = 0.3
    adiabatic: bool = False

    @model_validator(mode="after")
    def _one_way(self) -> "WallAnswer":
        if (self.temperature is None) == (not self.adiabatic):
            raise ValueError("give temperature or adiabatic = true, and not both")
        return self


class ThermometerAnswer(Strict):
    """A thermometer in the room's air."""

    position: tuple[Length, Length, Length]
    temperature: Temperature
    temperature_deviation: Difference = 0.2


class AnemometerAnswer(Strict):
    """An anemometer: the three components of the velocity, along x, y and z."""

    position: tuple[Length, Length, Length]
    velocity: tuple[Speed, Speed, Speed]
    deviation: Annotated[Speed, Field(gt=0)] = 0.05


class Answers(Strict):
    """All answers. `air` is the room's temperature when the reference picture is taken: no flow, no heat."""

    title: str = ""
    room: tuple[Size, Size, Size]
    air: Temperature
    camera: CameraAnswer
    projector: ProjectorAnswer | None = None
    pattern_seed: int = 0
    supply: tuple[SupplyAnswer, ...] = ()
    outlet: tuple[OutletAnswer, ...] = ()
    surface: tuple[SurfaceAnswer, ...] = ()
    wall: tuple[WallAnswer, ...] = ()
    thermometer: tuple[ThermometerAnswer, ...] = ()
    anemometer: tuple[AnemometerAnswer, ...] = ()
