"""What is asked about a rig and a room; `app/setup/templates` shows it filled in.

The room's corner is the origin: x runs along the patterned wall to the right as the camera sees it, y from the
camera to the patterned wall, z upwards. An opening is a rectangle on a wall: `lower` and `upper` are its two
corners along the wall's two axes, in the order x, y, z.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from app.files.toml import Strict
from app.setup.units import (
    Angle,
    Difference,
    Distance,
    Flow,
    Length,
    Power,
    PowerDeviation,
    Share,
    Size,
    Speed,
    Temperature,
    Time,
)
from core.geometry import WallName

# At most so many things of one kind are in a room.
MANY = 100
# So many letters has a name at most.
LONGEST = 200
# What the first camera is called, which `camera` answers.
FIRST = "camera"
Pixels = Annotated[int, Field(ge=16, le=20_000)]


class EyeAnswer(Strict):
    """A camera and its lens: where it stands is told as `distance` from its wall, else as `position`.

    The lens is known by its angle of view across the picture, or by focal length and pixel pitch. It is what
    calibration starts from.
    """

    kind: Literal["v4l2", "aravis", "simulated"]
    """A camera of the kernel, one of GigE Vision or USB3 Vision, or one that computes its pictures."""
    device: str = "/dev/video0"
    """Its device file, id or address; `airlens devices` lists them."""
    pixel_format: str = "Y16"
    """Raw or grey format, as the camera names it."""
    bits: Annotated[int, Field(ge=1, le=16)] = 12
    """Digits of a count."""
    width_px: Pixels
    """Columns."""
    height_px: Pixels
    """Rows."""
    exposure: Time | None = None
    """Exposure of a frame; the camera's own unless given."""
    frames: Annotated[int, Field(ge=1, le=100_000)] = 100
    """How many frames are averaged into one picture."""
    angle_of_view: Angle | None = None
    """Across the picture; or give the next two."""
    focal_length: Distance | None = None
    """Of the lens."""
    pixel_pitch: Distance | None = None
    """From one pixel of the sensor to the next."""
    distance: Distance | None = None
    """From the patterned wall, straight at its middle; or give `position`."""
    position: tuple[Length, Length, Length] | None = None
    """The lens, from the room's corner: x, y, z."""

    @model_validator(mode="after")
    def _one_lens_and_place(self) -> Self:
        lens = self.focal_length is not None and self.pixel_pitch is not None
        if lens == (self.angle_of_view is not None):
            raise ValueError("give angle_of_view, or focal_length and pixel_pitch, and not both")
        if (self.distance is None) == (self.position is None):
            raise ValueError("give distance (to the patterned wall) or position, and not both")
        return self


class CameraAnswer(EyeAnswer):
    """The camera, which looks at y_max, its lens, and where it stands: `distance` from its wall, else `position`.

    The lens is known by its angle of view across the picture, or by focal length and pixel pitch. It is what
    calibration starts from. A simulated camera looks at the room of `truth`: an NPZ file, or the
    packaged room, `sample`.
    """

    truth: str = ""
    """For a simulated camera: the room that it looks at (NPZ), or `sample`."""

    @model_validator(mode="after")
    def _a_room_to_look_at(self) -> Self:
        if (self.kind == "simulated") != bool(self.truth):
            raise ValueError("give truth, the room that it looks at, for a simulated camera, and only there")
        return self


class ProjectorAnswer(Strict):
    """A projector instead of a print: where its lens is, its panel, and its address if it can be spoken to."""

    position: tuple[Length, Length, Length]
    """The lens, from the room's corner: x, y, z."""
    width_px: Pixels
    """Columns of the panel."""
    height_px: Pixels
    """Rows of the panel."""
    angle_of_view: Angle
    """Across the picture."""
    url: str = ""
    """Its address, where it can be spoken to."""


class ViewAnswer(EyeAnswer):
    """A further camera: the wall that it looks at, and what patterns that wall. Of a simulated rig all are simulated.

    Cameras of one wall share its pattern: the first one of them tells it, and for y_max the first camera of all.
    """

    name: Annotated[str, Field(min_length=1, max_length=60)]
    """What it is called, in captures and calibrations."""
    wall: WallName
    """The wall that it looks at."""
    projector: ProjectorAnswer | None = None
    """A projector instead of a print on its wall."""
    pattern_seed: int = 0
    """Which of all random patterns is on its wall."""


class LightAnswer(ProjectorAnswer):
    """A further projector on a wall that one lights already: a second line of sight without a second camera.

    They light the wall in turn, for the same camera, which takes a picture under each. All are dark but one then, so
    each of them is spoken to where this machine takes the pictures. A print cannot be switched off.
    """

    name: Annotated[str, Field(min_length=1, max_length=60)]
    """What the pictures under it are called, in captures and calibrations."""
    camera_of: str = FIRST
    """The camera that takes them: `camera` is the first one, else the name of a `view`."""
    pattern_seed: int = 0
    """Which of all random patterns it shows."""


class OpeningAnswer(Strict):
    """A rectangle on a wall."""

    wall: WallName
    """The wall that it is on."""
    lower: tuple[Length, Length]
    """Its smaller corner along the wall's two axes, in the order x, y, z."""
    upper: tuple[Length, Length]
    """Its larger corner."""


class SupplyAnswer(OpeningAnswer):
    """Air that is blown in, straight off its wall: as volume flow, or as mean speed."""

    flow: Flow | None = None
    """Volume that comes in; or give `speed`."""
    speed: Speed | None = None
    """Mean speed over the opening."""
    deviation: Share = 0.05
    """Standard deviation of it, as a share."""
    temperature: Temperature
    """Of the air that comes in."""
    temperature_deviation: Difference = 0.3
    """Standard deviation of it."""

    @model_validator(mode="after")
    def _one_way(self) -> "SupplyAnswer":
        if (self.flow is None) == (self.speed is None):
            raise ValueError("give flow or speed, and not both")
        if self.speed is not None and self.speed <= 0:
            raise ValueError("speed is that of air coming in, above 0; where air leaves is an outlet")
        return self


class OutletAnswer(OpeningAnswer):
    """Where air leaves; a thermometer in it fixes the level of every temperature."""

    flow: Flow | None = None
    """Volume that leaves by it; outlets without it share what remains of the supplies' flow by area."""
    temperature: Temperature | None = None
    """Of the air that leaves; without a thermometer leave it out."""
    temperature_deviation: Difference = 0.3
    """Standard deviation of it."""


class SurfaceAnswer(OpeningAnswer):
    """A radiator, a heated floor, a cooled ceiling, a cold window: its surface's temperature."""

    temperature: Temperature
    """Of the surface."""
    temperature_deviation: Difference = 0.5
    """Standard deviation of it."""


class WallAnswer(Strict):
    """A whole wall: its surface's temperature, or `adiabatic = true` for one that passes no heat."""

    wall: WallName
    """Which wall."""
    temperature: Temperature | None = None
    """Of its surface; or give `adiabatic`."""
    temperature_deviation: Difference = 0.3
    """Standard deviation of it."""
    adiabatic: bool = False
    """Whether it passes no heat."""

    @model_validator(mode="after")
    def _one_way(self) -> "WallAnswer":
        if (self.temperature is None) == (not self.adiabatic):
            raise ValueError("give temperature or adiabatic = true, and not both")
        return self


class ObjectAnswer(Strict):
    """What stands in the room: a ready one by its kind, or a `box` of its own size.

    It is described by the heat that it gives to the air, or by its surface's temperature.
    """

    kind: Literal["box", "seated_person", "standing_person", "desk", "cabinet", "screen", "radiator"]
    """A kind has a usual size and heat (`core/objects.py` has their sources); a box has what is told here."""
    position: tuple[Length, Length, Length]
    """The middle of its foot, from the room's corner: x, y, z."""
    size: tuple[Distance, Distance, Distance] | None = None
    """Along x, y and z; that of its kind unless given."""
    heat: Power | None = None
    """What it gives to the air by convection; that of its kind unless given."""
    heat_deviation: PowerDeviation | None = None
    """Standard deviation of it; that of its kind unless given."""
    temperature: Temperature | None = None
    """Of its surface, instead of its heat."""
    temperature_deviation: Difference = 0.5
    """Standard deviation of it."""

    @model_validator(mode="after")
    def _one_way(self) -> "ObjectAnswer":
        if self.kind == "box" and self.size is None:
            raise ValueError("a box has a size; give it, or a kind that has one")
        if self.heat is not None and self.temperature is not None:
            raise ValueError("give heat or temperature, and not both")
        return self


class ThermometerAnswer(Strict):
    """A thermometer in the room's air."""

    position: tuple[Length, Length, Length]
    """From the room's corner: x, y, z."""
    temperature: Temperature
    """What it shows."""
    temperature_deviation: Difference = 0.2
    """Standard deviation of it."""


class AnemometerAnswer(Strict):
    """An anemometer: the three components of the velocity, along x, y and z."""

    position: tuple[Length, Length, Length]
    """From the room's corner: x, y, z."""
    velocity: tuple[Speed, Speed, Speed]
    """Along x, y and z."""
    deviation: Annotated[Speed, Field(gt=0)] = 0.05
    """Standard deviation of each."""


class Answers(Strict):
    """All answers. `air` is the room's temperature when the reference picture is taken: no flow, no heat."""

    title: Annotated[str, Field(max_length=LONGEST)] = ""
    """A name for people; the room's size unless given."""
    room: tuple[Size, Size, Size]
    """Length along x, y and z."""
    air: Temperature
    """Temperature of the still air before the reference picture."""
    camera: CameraAnswer
    """The camera."""
    projector: ProjectorAnswer | None = None
    """A projector instead of a print."""
    pattern_seed: int = 0
    """Which of all random patterns."""
    view: tuple[ViewAnswer, ...] = Field(default=(), max_length=MANY)
    """Further cameras, each before its wall."""
    light: tuple[LightAnswer, ...] = Field(default=(), max_length=MANY)
    """Further projectors, each in turn with those of its camera's wall."""
    supply: tuple[SupplyAnswer, ...] = Field(default=(), max_length=MANY)
    """Where air is blown in."""
    outlet: tuple[OutletAnswer, ...] = Field(default=(), max_length=MANY)
    """Where air leaves."""
    surface: tuple[SurfaceAnswer, ...] = Field(default=(), max_length=MANY)
    """Warm and cold surfaces."""
    wall: tuple[WallAnswer, ...] = Field(default=(), max_length=MANY)
    """Walls of which something is known."""
    object: tuple[ObjectAnswer, ...] = Field(default=(), max_length=MANY)
    """People and furniture."""
    thermometer: tuple[ThermometerAnswer, ...] = Field(default=(), max_length=MANY)
    """Thermometers in the air."""
    anemometer: tuple[AnemometerAnswer, ...] = Field(default=(), max_length=MANY)
    """Anemometers in the air."""
