"""Captures, and the burst that is being taken."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel

Role = Literal["reference", "flow", "dark", "flat"]


class DeskResource(WireModel):
    """The capture that is being taken, or the last one.

    `done` of `total` frames are taken of burst number `burst` of `bursts`.
    """

    state: Literal["idle", "running", "finished", "aborted", "incomplete", "failed"]
    experiment: str | None
    capture: str | None
    role: str | None
    burst: int
    bursts: int
    done: int
    total: int
    refused: int
    level: float
    reason: str


class NewCapture(WireModel):
    """A burst, or several: every field by the name that it has on the command line and in the manifest.

    `exposure_s` and `gain` hold for this capture; left out, they are the camera's own. `minutes_on` says how
    long the rig has been on; left out, the projector's lamp tells. So does the scene the temperature. `at_once`:
    several cameras take theirs at the same time; else in turn. With `live` T of each burst of a flow is looked at
    as it comes.
    """

    role: Role
    frames: int = Field(default=100, ge=1, le=100_000)
    exposure_s: float | None = Field(default=None, gt=0, le=60)
    gain: float | None = Field(default=None, ge=0, le=1000)
    settle_s: float = Field(default=0.0, ge=0, le=600)
    settle_frames: int = Field(default=30, ge=0, le=1000)
    max_refused: int = Field(default=100, ge=0, le=100_000)
    refresh_hz: float | None = Field(default=None, gt=0, le=1000)
    raw_stack: bool = False
    bursts: int = Field(default=1, ge=1, le=10_000)
    every_s: float = Field(default=0.0, ge=0, le=86_400)
    ambient_temperature_k: float | None = Field(default=None, ge=150, le=400)
    minutes_on: float | None = Field(default=None, ge=0, le=1e6)
    at_once: bool = False
    live: bool = False


class Retake(WireModel):
    """One camera's picture of a capture taken again, alone, as it was asked for: `view` is its name.

    Left out, it is the one that is missing. `ambient_temperature_k` and `minutes_on` are as in NewCapture.
    """

    view: str | None = Field(default=None, max_length=200)
    ambient_temperature_k: float | None = Field(default=None, ge=150, le=400)
    minutes_on: float | None = Field(default=None, ge=0, le=1e6)


class RolePictures(WireModel):
    """Uploaded pictures of one role: each upload is a picture, or a TIFF of many.

    `view` is the camera's; where there is one view it may be left out.
    """

    role: Role
    view: str | None = Field(default=None, max_length=200)
    uploads: list[Named] = Field(min_length=1, max_length=1000)


class NewImport(WireModel):
    """Pictures that another camera took. `bits` are those of the counts where the files hold more.

    A capture of several views waits, as an interrupted one, until the pictures of all are there.
    """

    pictures: list[RolePictures] = Field(min_length=1, max_length=64)
    bits: int | None = Field(default=None, ge=1, le=16)
    ambient_temperature_k: float | None = Field(default=None, ge=150, le=400)


class Abort(WireModel):
    """What becomes of the frames that were taken."""

    discard: bool = False


class VerdictResource(WireModel):
    """One judgement of a burst: `value` against `expected`, and what to do when it is not good."""

    name: str
    good: bool
    value: float
    expected: str
    advice: str


class SettingResource(WireModel):
    """A setting as asked for and as granted; null where the camera has no such control."""

    name: str
    asked: float | None
    granted: float | None


class ViewPicture(WireModel):
    """What one camera took of a capture, and how good it is."""

    view: str
    frames: int | None
    width_px: int | None
    height_px: int | None
    verdicts: list[VerdictResource]
    settings: list[SettingResource]


class CaptureResource(WireModel):
    """One capture. `interrupted` ones have no manifest and are never used as a measurement.

    `views` are the cameras' pictures, each with its verdicts; frames, size, verdicts and settings beside it are those
    of the first. `missing` names the views that an interrupted one waits for; `retakes` says whether one view of it
    can be taken alone.

    `sequence` is the same for all bursts of one sequence, and none for a single burst.
    `reason` says why a `broken` one cannot be read. `revision` goes into the `If-Match` of a change of its notes.
    """

    capture: str
    state: Literal["finished", "incomplete", "interrupted", "broken"]
    role: str | None
    created: str | None
    frames: int | None
    width_px: int | None
    height_px: int | None
    verdicts: list[VerdictResource]
    settings: list[SettingResource]
    notes: str
    revision: str
    views: list[ViewPicture]
    missing: list[str]
    retakes: bool = False
    sequence: str | None = None
    reason: str = ""


class CaptureChange(WireModel):
    """What people wrote about it."""

    notes: str = Field(max_length=10_000)
