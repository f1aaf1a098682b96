"""Ray model, steps, projector order and the irradiance term, from rays traced through the expected flow.

A thousand rays of this scene are traced by the candidate and by the dearest model: nonlinear, twice the
finest steps, three Picard corrections.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.fields import AbstractField
from core.plan.choice import SHARE, Choice
from core.plan.expected import ExpectedFlow
from core.plan.signal import Signal
from core.rays import AbstractRayTracer, NonlinearTracer, QuasiLinearTracer, StraightTracer
from core.render import pixel_geometry
from core.render.irradiance import irradiance_factor
from core.render.shift import wall_offset_m
from core.scene import Scene
from core.view_frame import facing, turn_of

_RAYS = 1024
# A quarter apart at most, so that the fewest steps that serve cost little less.
_STEPS = (16, 19, 23, 27, 32, 38, 45, 54, 64, 76, 91, 108, 128, 152, 181, 215, 256)
_MOST_ORDER = 3
_TRACERS = {"straight": StraightTracer, "quasi_linear": QuasiLinearTracer, "nonlinear": NonlinearTracer}


@dataclass(frozen=True)
class Probe:
    """Sampled rays of one view, and what a choice may cost them."""

    scene: Scene
    view: int
    pixels: Float[np.ndarray, "rays 2"]
    field: AbstractField
    limit_px: float
    px_per_m: float

    def shift_px(self, tracer: AbstractRayTracer, order: int) -> Float[np.ndarray, "rays 3"]:
        """Offsets on the wall in pixels."""
        geometry = pixel_geometry(self.scene, self.view, self.pixels)
        return np.asarray(_offset(geometry, self.field, tracer, order), np.float64) * self.px_per_m

    def bound(self, one: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of any ray."""
        return float(np.abs(one - other).max())


_offset = eqx.filter_jit(wall_offset_m)


def probe_of(scene: Scene, view: int, flow: ExpectedFlow, signal: Signal) -> Probe:
    """Rays of one view: half where the shift is largest, half anywhere on the wall."""
    centres, size = signal.shift.centres_px, np.linalg.norm(signal.shift.displacement_px, axis=1)
    strongest = np.argsort(size)[::-1][: _RAYS // 2]
    anywhere = np.random.default_rng(0).choice(len(centres), min(_RAYS // 2, len(centres)), replace=False)
    chosen = centres[np.resize(np.concatenate([strongest, anywhere]), _RAYS)]
    field = flow.facing(turn_of(scene, view)).field(scene.air)
    scene, view = facing(scene, view)
    camera = scene.views[view].camera
    px_per_m = max(camera.focal_px) / (scene.room.upper_m[1] - camera.position_m[1])
    limit_px = SHARE * signal.noise.mean_px
    return Probe(scene, view, chosen, field, limit_px, px_per_m)


def tracer_of(kind: str, steps: int, scene: Scene) -> AbstractRayTracer:
    """The tracer of a name in `scene.rays`."""
    return _TRACERS[kind](steps, scene.air.ambient_refractivity)


def tracing(probe: Probe, cells: int) -> tuple[str, int, list[Choice]]:
    """Straight rays where many steps of them hold, else nonlinear; then the fewest steps that hold.

    No fewer than one a cell of the answer's grid: a real flow is narrower than the expected one.
    """
    scene = probe.scene
    dearest = _STEPS[-1] * 2
    exact = probe.shift_px(tracer_of("nonlinear", dearest, scene), 1)
    given, steps = scene.rays.tracer, scene.rays.steps
    counts = (cells, *(n for n in _STEPS if n > cells)) if steps == "auto" else (steps,)

    def bound_of(kind: str, count: int) -> float:
        return probe.bound(probe.shift_px(tracer_of(kind, count, scene), 1), exact)

    kind = given
    if given == "auto":
        # With the most steps only the model's own error is left.
        kind = "straight" if bound_of("straight", counts[-1]) <= probe.limit_px else "nonlinear"
    count, bound = _fewest(counts, lambda count: bound_of(kind, count), probe.limit_px)
    return kind, count, _tracing_choices(bound, kind, count, probe, dearest)


def _fewest(counts: Sequence[int], bound_of: Callable[[int], float], limit: float) -> tuple[int, float]:
    """The fewest steps whose bound holds, by bisection; the most where none does."""
    fewest, most = 0, len(counts) - 1
    bounds = {fewest: bound_of(counts[fewest])}
    if bounds[fewest] > limit:
        bounds[most] = bound_of(counts[most])
        while most - fewest > 1 and bounds[most] <= limit:
            middle = (fewest + most) // 2
            bounds[middle] = bound_of(counts[middle])
            fewest, most = (fewest, middle) if bounds[middle] <= limit else (middle, most)
        fewest = most
    return counts[fewest], bounds[fewest]


def _tracing_choices(bound: float, kind: str, steps: int, probe: Probe, dearest: int) -> list[Choice]:
    share = steps / dearest
    words = "straight rays differ by more than the limit"
    if kind == "straight":
        words = "bending feeds back on the path by less than the limit: one matrix serves every iteration"
    if bound > probe.limit_px:
        words = "no choice within reach stays below the limit"
    return [
        Choice("ray model", kind, bound, probe.limit_px, "px", share, words),
        Choice("steps", steps, bound, probe.limit_px, "px", share, f"against {dearest} steps"),
    ]


def projector_order(probe: Probe, tracer: AbstractRayTracer) -> Choice:
    """How often the projector's own bending is looked up again, against three Picard corrections."""
    exact = probe.shift_px(tracer, _MOST_ORDER)
    given = probe.scene.rays.projector_order
    bounds = {
        n: probe.bound(probe.shift_px(tracer, n), exact) for n in ((1, 2) if given == "auto" else (given,))
    }
    value = next((n for n, bound in bounds.items() if bound <= probe.limit_px), max(bounds))
    return Choice(
        "projector order", value, bounds[value], probe.limit_px, "px", (1 + value) / (1 + _MOST_ORDER),
        "where the light that lands on a wall point left the projector",
    )  # fmt: skip


def irradiance(probe: Probe, signal: Signal, tracer: AbstractRayTracer) -> Choice:
    """Gain and offset of a window are fitted away: what is left is the gain's change across the window."""
    half = signal.noise.window_px / 2
    gains = []
    for move in (-half, half):
        geometry = pixel_geometry(probe.scene, probe.view, probe.pixels + np.array([move, 0.0]))
        offset = _offset(geometry, probe.field, tracer, 1)
        gains.append(np.asarray(_gain(geometry, probe.field, tracer, offset)))
    slope = float(np.abs(gains[1] - gains[0]).max())
    noise = signal.noise
    # The pattern's cells correlate with the slope at random: their number's square root averages it.
    cells = max(1.0, noise.window_px * noise.gradient_per_px / (noise.brightness * noise.contrast))
    bound = slope * noise.brightness / noise.gradient_per_px / cells
    given = probe.scene.rays.irradiance
    value = bound > probe.limit_px if given == "auto" else given
    return Choice(
        "irradiance", value, 0.0 if value else bound, probe.limit_px, "px", 1.0 if value else 0.2,
        "the light that refraction gathers changes brightness over the flow's size, not the pattern's",
    )  # fmt: skip


_gain = eqx.filter_jit(irradiance_factor)
