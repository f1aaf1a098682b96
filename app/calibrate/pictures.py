"""Takes the pictures of a calibration and keeps each as soon as it is taken, in the layout that `--images` reads.

calibration/live-camera/view_00.png
calibration/live-projector/place_00/graycode_00.png
calibration/live-wall/graycode_00.png, live-level/level.png
calibration/live-response/dark/00.png, grey_128/00.png, exposure_0.02/00.png
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import tifffile

from app.capture.burst import shoot
from app.capture.watched import BurstWatch
from app.errors import AirlensError
from app.files.durable import write_durably
from app.rig.stage import Stage
from calibration.graycode import patterns
from drivers.burst import Burst, BurstOutcome, CapturePlan, CaptureRole
from drivers.capture import Abort, OnFrame, Taken
from drivers.display import Picture
from drivers.protocols import Frame

OnPicture = Callable[[int, int], object]


class CalibrationStoppedError(AirlensError):
    """The operator stopped; what was taken before is kept."""


class Shooter:
    """One stage's camera and screen; `progress(done, total)` hears of every picture."""

    def __init__(
        self, stage: Stage, frames: int, settle_s: float, progress: OnPicture, abort: Abort | None = None
    ) -> None:
        self._stage, self._frames, self._settle_s = stage, frames, settle_s
        self._progress, self._abort = progress, abort or (lambda: False)

    def one(self, file: Path) -> Path:
        """Take one picture (the mean of `frames`) and return where it was kept.

        Raises CalibrationStoppedError, DeviceError.
        """
        newest: list[Frame] = []

        def remember(taken: Taken) -> None:
            newest[:] = [taken.frame]

        plan = CapturePlan(role="flat", frames=self._frames, settle_s=self._settle_s)
        burst = self._shoot(file.parent, plan, remember)
        _check(burst.outcome, file)
        if burst.frames == 1:
            return save(file, newest[0].pixels)
        return save(file.with_suffix(".tif"), burst.mean * np.float32(burst.full_scale_counts))

    def gray_code(self, folder: Path) -> None:
        """Show every Gray-code pattern and take a picture of each; the screen must keep showing it."""
        shown = patterns(*self._panel_px())
        for number, pattern in enumerate(shown):
            self._show(pattern)
            self.one(folder / f"graycode_{number:02d}.png")
            self._progress(number + 1, len(shown))

    def burst(self, folder: Path, frames: int, *, dark: bool = False) -> float:
        """Keep every frame of a burst, for its noise; return their mean level, a part of full scale."""
        role: CaptureRole = "dark" if dark else "flat"
        plan = CapturePlan(role=role, frames=frames, settle_s=self._settle_s, raw_stack=True)

        def keep(taken: Taken) -> None:
            save(folder / f"{taken.moments.frames - 1:02d}.png", taken.frame.pixels)
            self._progress(taken.moments.frames, frames)

        burst = self._shoot(folder, plan, keep)
        _check(burst.outcome, folder)
        return float(burst.mean.mean())

    def light(self, level: int = 255) -> None:
        """Light everything evenly, where there is a projector."""
        if self._stage.display is not None:
            width_px, height_px = self._panel_px()
            self._show(np.full((height_px, width_px), level, np.uint8))

    def _shoot(self, where: Path, plan: CapturePlan, on_frame: OnFrame) -> Burst:
        watch = BurstWatch(
            frame=lambda taken, _view: on_frame(taken), stop=lambda: "keep" if self._abort() else None
        )
        return shoot(self._stage.camera, where, plan, watch)

    def _show(self, picture: Picture) -> None:
        display = self._stage.display
        if display is None:
            raise AirlensError(
                "This rig has no screen to show patterns with. Open the projector's page first."
            )
        if not display.is_showing(display.show(picture)):
            raise AirlensError(
                "The projector's page no longer shows the pattern. Put it back, and try again."
            )

    def _panel_px(self) -> tuple[int, int]:
        if self._stage.panel_px is None:
            raise AirlensError(
                "The projector's size is not known; give its native pixels, such as --projector-px 1024x768."
            )
        return self._stage.panel_px


def save(file: Path, pixels: np.ndarray) -> Path:
    """Write a picture durably: PNG as the camera gave it, means as TIFF. Raises OSError, as of a full disk."""

    def write(temporary: Path) -> None:
        if file.suffix == ".png":
            temporary.write_bytes(cv2.imencode(".png", pixels)[1].tobytes())  # imwrite tells no error
        else:
            tifffile.imwrite(temporary, pixels)

    write_durably(file, write)
    return file


def _check(outcome: BurstOutcome, where: Path) -> None:
    if outcome is BurstOutcome.ABORTED:
        raise CalibrationStoppedError(
            "Stopped. The pictures taken so far are kept; the same command goes on from there."
        )
    if outcome is not BurstOutcome.COMPLETE:
        raise AirlensError(
            f"The camera ended the burst early ({outcome.value}) at {where.name}. Check it, then run the same "
            "command again; the pictures before it are kept."
        )
