"""What a burst is: the plan (asked), the records (happened), the moments (kept), and how it ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import numpy as np
from jaxtyping import Float32

from drivers.errors import DeviceSettingError
from drivers.protocols import CameraInfo
from drivers.settings import Setting
from drivers.verdict import Verdict

CaptureRole = Literal["reference", "flow", "dark", "flat"]


@dataclass(frozen=True)
class CapturePlan:
    """A burst as data. `exposure_s` and `gain` hold for this burst; left at None they are the operator's.

    `settle_s` is waited first; then frames are discarded until a change of the settings has acted and two in a row
    are equally bright, at most `settle_frames` of them. `max_refused` ends a burst whose camera keeps losing
    frames. `refresh_hz` is the projector's: exposures that are not a whole number of its periods are warned of.
    `raw_stack` keeps every frame.
    """

    role: CaptureRole = "reference"
    frames: int = 100
    exposure_s: float | None = None
    gain: float | None = None
    settle_s: float = 0.0
    settle_frames: int = 30
    max_refused: int = 100
    refresh_hz: float | None = None
    raw_stack: bool = False

    def __post_init__(self) -> None:
        if self.frames < 1 or self.settle_s < 0 or self.max_refused < 0:
            raise DeviceSettingError(
                f"A capture plan has frames {self.frames}, settle_s {self.settle_s:g}, max_refused "
                f"{self.max_refused}; expected at least one frame and no negative number."
            )


class BurstOutcome(StrEnum):
    """How a burst ended. Only COMPLETE is a measurement; of the others the frames so far are kept."""

    COMPLETE = "complete"
    ABORTED = "aborted"
    DEVICE_LOST = "device lost"
    TOO_MANY_REFUSED = "too many refused"

    @property
    def advice(self) -> str:
        """What to do before it is taken again; empty where the burst's verdicts say it."""
        if self is BurstOutcome.DEVICE_LOST:
            return "Plug the camera in; `airlens devices` lists what is there."
        return ""


@dataclass(frozen=True)
class FrameRecord:
    """Metadata of one frame in the mean. `level` and `saturated` are parts of full scale and of pixels."""

    sequence: int
    timestamp_s: float
    level: float
    saturated: float


@dataclass(frozen=True)
class Progress:
    """How far a burst is."""

    done: int
    total: int
    refused: int
    level: float


@dataclass(frozen=True)
class Burst:
    """Mean and standard deviation of one frame, in parts of full scale, with all that is known of them."""

    mean: Float32[np.ndarray, "rows cols"]
    std: Float32[np.ndarray, "rows cols"]
    plan: CapturePlan
    outcome: BurstOutcome
    camera: CameraInfo
    full_scale_counts: int
    settings: tuple[Setting, ...]
    records: tuple[FrameRecord, ...]
    refused: Mapping[str, int] = field(default_factory=dict)
    verdicts: tuple[Verdict, ...] = ()

    @property
    def frames(self) -> int:
        """Frames in the mean."""
        return len(self.records)
