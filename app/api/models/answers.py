"""Answers about a room as they were written, with units; what is wrong in them, and what they make."""

from typing import Any, Literal

from pydantic import Field

from app.api.models.calibrations import StandingResource
from app.api.models.strict import Named, WireModel


class TemplateResource(WireModel):
    """Filled-in answers to start from."""

    template: str
    title: str
    answers: dict[str, Any]


class FoundFormat(WireModel):
    """A format of a camera, at one size."""

    pixel_format: str
    bits: int
    width_px: int
    height_px: int


class FoundCamera(WireModel):
    """A camera to choose, with what it would be asked for; `error` says why it cannot be used."""

    kind: Literal["v4l2", "aravis", "simulated"]
    device: str
    name: str
    pixel_format: str
    bits: int
    width_px: int
    height_px: int
    error: str = ""
    formats: tuple[FoundFormat, ...] = ()


class PortResource(WireModel):
    """A serial port, as the system describes it."""

    device: str
    description: str


class AskPort(WireModel):
    """A serial port that was listed."""

    device: str = Field(max_length=1000)


class PortAnswer(WireModel):
    """Who answered on a port: the address to speak to it by, its name, its power state."""

    found: bool
    url: str = ""
    name: str = ""
    power: str = ""


class SentAnswers(WireModel):
    """Answers, for a new experiment or for the one that is named."""

    answers: dict[str, Any] = Field(max_length=100)
    experiment: Named | None = None


class NewAnswers(WireModel):
    """Answers as answers.toml holds them."""

    answers: dict[str, Any] = Field(max_length=100)


class MistakeResource(WireModel):
    """What is wrong at one field, such as `supply[0].flow`; `field` is empty where it is wrong of all together."""

    field: str
    sentence: str


class SupplyTold(WireModel):
    """What a supply's answer means."""

    field: str
    speed_m_s: float
    flow_m3_h: float


class ViewTold(WireModel):
    """What a camera sees of its wall, and the wall itself: width and height as it sees them."""

    name: str
    wall: str
    picture_m: list[float]
    wall_m: list[float]


class RoomTold(WireModel):
    """What the answers make: the picture on the patterned wall and the wall itself (width, height), the room's two
    corners, the supplies, what each camera sees, who stands where, and the settings in SI."""

    picture_m: list[float]
    wall_m: list[float]
    room_m: list[list[float]]
    supplies: list[SupplyTold]
    views: list[ViewTold]
    standing: list[StandingResource]
    settings: dict[str, Any]


class CheckResource(WireModel):
    """Every mistake in answers; `told` where there is none."""

    mistakes: list[MistakeResource]
    told: RoomTold | None


class AnswersResource(WireModel):
    """The answers of an experiment; `unsaid` tells what they leave out and a change leaves as it is; `revision` goes
    into the `If-Match` of a change."""

    answers: dict[str, Any]
    unsaid: list[str]
    revision: str
