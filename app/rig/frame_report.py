"""What one frame tells: a line for the operator, and a picture for the eye."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from app.errors import AirlensError
from app.files.durable import write_durably
from drivers.protocols import Camera, Frame
from drivers.saturation import saturated_share
from drivers.verdict import Verdict, judge_images, judge_saturation


@dataclass(frozen=True)
class FrameQuality:
    """Level, saturation, contrast and focus of one frame, judged."""

    sequence: int
    verdicts: tuple[Verdict, ...]

    @property
    def line(self) -> str:
        """One line: what is good, what is not, and what to do about the first of these."""
        parts = [f"{v.name} {v.value:.3g}{'' if v.good else ' (!)'}" for v in self.verdicts]
        advice = next((v.advice for v in self.verdicts if not v.good), "")
        return ", ".join(parts) + (f". {advice}" if advice else "")

    def as_json(self) -> dict[str, Any]:
        """The same as data."""
        verdicts = [
            {"name": v.name, "good": v.good, "value": v.value, "advice": v.advice} for v in self.verdicts
        ]
        return {"sequence": self.sequence, "verdicts": verdicts}


def judge_frame(camera: Camera, frame: Frame) -> FrameQuality:
    """Return the quality of one frame; temporal noise needs a burst and is left out."""
    image = (frame.pixels / np.float32(frame.full_scale_counts)).astype(np.float32)
    judged = judge_images(image, np.zeros_like(image), 1)
    kept = [verdict for verdict in judged if verdict.name != "temporal noise"]
    return FrameQuality(
        frame.sequence, (*kept, judge_saturation([saturated_share(frame)], camera.exposure_s))
    )


def write_picture(path: Path, frame: Frame, longest_px: int = 1600) -> None:
    """Write an 8-bit picture for the eye: stretched, and reduced. The data themselves are never stretched."""
    low, high = np.percentile(frame.pixels[::4, ::4], (0.5, 99.5))
    grey = np.clip((frame.pixels - low) * (255.0 / max(high - low, 1.0)), 0, 255).astype(np.uint8)
    scale = min(1.0, longest_px / max(grey.shape))
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(path.suffix or ".png", grey)
    if not done:
        raise AirlensError(f"A picture cannot be written as {path.suffix!r}; give a name that ends in .png.")
    write_durably(path, lambda temporary: temporary.write_bytes(data.tobytes()))
