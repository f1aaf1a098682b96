"""The same choices after measuring, by the measured shift and its noise."""

import numpy as np
from jaxtyping import Float32

from core.displacement import standard_deviation_px
from core.plan.choices import Resolution, resolve
from core.plan.expected import plume_flow
from core.plan.shift_noise import ShiftNoise
from core.plan.signal import ShiftMap, Signal
from core.problem import Problem, ShiftMeasurement

Image = Float32[np.ndarray, "_ _"]


def resolve_measured(problem: Problem, references: tuple[Image, ...]) -> Resolution:
    """Settle every `auto` by the measured noise, and a plume that moves the pattern as far as it moved."""
    flow = plume_flow(problem)
    contrast_k = float(np.abs(flow.excess_k).max())
    signals = tuple(
        _signal(shift, image, contrast_k, problem.scene.air.ambient_temperature_k)
        for shift, image in zip(problem.shifts, references, strict=True)
    )
    return resolve(problem.scene, flow, signals)


def _signal(shift: ShiftMeasurement, image: Image, contrast_k: float, ambient_k: float) -> Signal:
    column, row = np.median(standard_deviation_px(shift), axis=0)
    brightness = float(image.mean())
    noise = ShiftNoise(
        (float(column), float(row)),
        shift.window_px,
        brightness,
        float(image.std()) / max(brightness, 1e-12),
        max(float(np.std(np.gradient(image, axis=1))), 1e-12),
    )
    return Signal(ShiftMap(shift.centres_px, shift.displacement_px, 1), noise, contrast_k, ambient_k)
