"""Every `auto` resolved: the cheapest choice whose bound stays below a stated share of the noise.

Bounds on the shift come from tracing a few hundred rays of this scene through the expected flow, by the
candidate and by the dearest model (nonlinear, twice the finest steps, three Picard corrections); others
are the leading term of the error that the choice makes. A bound is doubled for what the sample missed.
"""

from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.fields import AbstractField
from core.plan.expected import ExpectedFlow
from core.plan.signal import Signal
from core.rays import AbstractRayTracer, NonlinearTracer, StraightTracer
from core.render import pixel_geometry
from core.render.irradiance import irradiance_factor
from core.render.shift import wall_offset_m
from core.scene import Inlet, ProjectedPattern, Scene

# A choice may cost the shift a tenth of one window's noise, and a grid a tenth of the flow's departures.
SHARE = 0.1
_SAFETY = 2.0
_RAYS = 256
_STEPS = (16, 32, 64, 128, 256)
_MOST_ORDER = 3
_FLOAT32 = 2e-6


@dataclass(frozen=True)
class Choice:
    """One resolved `auto`: its bound and the limit it was held against, and cost as a share of the dearest."""

    name: str
    value: Any
    bound: float
    limit: float
    unit: str
    cost_share: float
    reason: str

    @property
    def holds(self) -> bool:
        """Whether the bound is below its limit."""
        return self.bound <= self.limit


@dataclass(frozen=True)
class Resolution:
    """The scene with its `auto` values settled, and why."""

    scene: Scene
    choices: tuple[Choice, ...]


@dataclass(frozen=True)
class _Probe:
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
        """Largest difference, doubled."""
        return _SAFETY * float(np.abs(one - other).max())


_offset = eqx.filter_jit(wall_offset_m)


def resolve(scene: Scene, flow: ExpectedFlow, signals: tuple[Signal, ...]) -> Resolution:
    """Settle every `auto` of the scene for this flow and this noise; given values are kept and judged."""
    view = int(np.argmin([s.noise.mean_px for s in signals]))
    probe = _probe(scene, view, flow, signals[view])
    tracer, steps, tracing = _tracing(probe)
    made = [*tracing]
    rays = replace(scene.rays, tracer=tracer, steps=steps)
    if isinstance(scene.light, ProjectedPattern):
        order = _projector_order(probe, _tracer(tracer, steps, scene))
        irradiance = _irradiance(probe, signals[view], _tracer(tracer, steps, scene))
        rays = replace(rays, projector_order=order.value, irradiance=irradiance.value)
        made += [order, irradiance]
    aperture = _aperture(scene, view, signals[view])
    made += [
        aperture,
        _data_term(scene, view, signals[view]),
        _window(signals[view]),
        _precision(signals[view]),
    ]
    grid = _grid(scene, flow)
    transport = _transport(scene, flow)
    made += [grid, transport]
    solve = replace(scene.solve, grid=grid.value, data_term=made[-5].value)
    settled = replace(
        scene,
        rays=replace(rays, aperture_cone=aperture.value),
        solve=solve,
        flow=replace(scene.flow, transport=transport.value),
    )
    return Resolution(settled, tuple(made))


def _probe(scene: Scene, view: int, flow: ExpectedFlow, signal: Signal) -> _Probe:
    centres, size = signal.shift.centres_px, np.linalg.norm(signal.shift.displacement_px, axis=1)
    # Half where the shift is largest, half anywhere.
    strongest = np.argsort(size)[::-1][: _RAYS // 2]
    anywhere = np.random.default_rng(0).choice(len(centres), min(_RAYS // 2, len(centres)), replace=False)
    chosen = centres[np.resize(np.concatenate([strongest, anywhere]), _RAYS)]
    camera = scene.views[view].camera
    px_per_m = max(camera.focal_px) / (scene.room.upper_m[1] - camera.position_m[1])
    limit_px = SHARE * signal.noise.mean_px
    return _Probe(scene, view, chosen, flow.field(scene.air), limit_px, px_per_m)


def _tracer(kind: str, steps: int, scene: Scene) -> AbstractRayTracer:
    maker = StraightTracer if kind == "straight" else NonlinearTracer
    return maker(steps, scene.air.ambient_refractivity)


def _tracing(probe: _Probe) -> tuple[str, int, list[Choice]]:
    """Ray model and steps together: the fewest steps at which a model holds, straight before nonlinear."""
    scene = probe.scene
    dearest = _STEPS[-1] * 2
    exact = probe.shift_px(_tracer("nonlinear", dearest, scene), 1)
    given, steps = scene.rays.tracer, scene.rays.steps
    kinds = ("straight", "nonlinear") if given == "auto" else (given,)
    best: tuple[float, str, int] | None = None
    for count in _STEPS if steps == "auto" else (steps,):
        for kind in kinds:
            bound = probe.bound(probe.shift_px(_tracer(kind, count, scene), 1), exact)
            if best is None or bound < best[0]:
                best = (bound, kind, count)
            if bound <= probe.limit_px:
                return kind, count, _tracing_choices(bound, kind, count, probe, dearest)
    bound, kind, count = best or (np.inf, "nonlinear", dearest)
    return kind, count, _tracing_choices(bound, kind, count, probe, dearest)


def _tracing_choices(bound: float, kind: str, steps: int, probe: _Probe, dearest: int) -> list[Choice]:
    share = steps / dearest
    words = (
        "bending feeds back on the path by less than the limit: one matrix serves every iteration"
        if kind == "straight"
        else "straight rays differ by more than the limit"
    )
    return [
        Choice("ray model", kind, bound, probe.limit_px, "px", share, words),
        Choice("steps", steps, bound, probe.limit_px, "px", share, f"against {dearest} steps"),
    ]


def _projector_order(probe: _Probe, tracer: AbstractRayTracer) -> Choice:
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


def _irradiance(probe: _Probe, signal: Signal, tracer: AbstractRayTracer) -> Choice:
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


def _aperture(scene: Scene, view: int, signal: Signal) -> Choice:
    """The lens averages the shift over a disc of diameter d: an error of d^2 / 32 times its curvature."""
    eye, given = scene.views[view], scene.rays.aperture_cone
    limit = SHARE * signal.noise.mean_px
    if eye.f_number is None or eye.focal_m is None:
        return Choice(
            "aperture cone", False, 0.0, limit, "px", 1 / 7, "no f_number and focal_m are given: a pinhole"
        )
    to_wall_m = scene.room.upper_m[1] - eye.camera.position_m[1]
    disc_m = eye.focal_m / eye.f_number * scene.room.size_m[1] / to_wall_m
    disc_px = disc_m * max(eye.camera.focal_px) / to_wall_m
    bound = _SAFETY * disc_px**2 / 32 * _curvature_per_px2(signal)
    value = bound > limit if given == "auto" else given
    reason = f"the lens sees the front of the room through a disc of {1e3 * disc_m:.1f} mm"
    return Choice(
        "aperture cone", value, 0.0 if value else bound, limit, "px", 1.0 if value else 1 / 7, reason
    )


def _data_term(scene: Scene, view: int, signal: Signal) -> Choice:
    """The images are linear in the shift to (2 pi d / period)^2 / 6 of it."""
    largest = signal.shift.percentile_px(100)
    period_px = 2 * np.pi * signal.noise.brightness * signal.noise.contrast / signal.noise.gradient_per_px
    bound = largest * (2 * np.pi * largest / period_px) ** 2 / 6
    limit = SHARE * signal.noise.mean_px
    given = scene.solve.data_term
    value = ("displacement" if bound <= limit else "warped") if given == "auto" else given
    return Choice(
        "data term", value, bound if value == "displacement" else 0.0, limit, "px",
        len(signal.shift.centres_px) * signal.shift.stride**2 / scene.views[view].camera.width_px
        / scene.views[view].camera.height_px if value == "displacement" else 1.0,
        f"shifts of at most {largest:.2g} px on a pattern of {period_px:.0f} px a period",
    )  # fmt: skip


def _window(signal: Signal) -> Choice:
    """A window averages the shift: an error of w^2 / 24 times its curvature."""
    window_px = signal.noise.window_px
    bound = window_px**2 / 24 * _curvature_per_px2(signal)
    return Choice(
        "window", window_px, bound, signal.noise.mean_px, "px", 1 / window_px**2,
        "the operator averages over the same window, so that the bound is what a wrong shape would cost",
    )  # fmt: skip


def _precision(signal: Signal) -> Choice:
    bound = _FLOAT32 * signal.shift.percentile_px(100)
    return Choice(
        "precision", "float32", bound, SHARE * signal.noise.mean_px, "px", 0.5,
        "deviations from straight rays and excess refractivity are carried, never absolute values",
    )  # fmt: skip


def _curvature_per_px2(signal: Signal) -> float:
    """99th percentile of the shift's second differences."""
    columns, rows = (np.unique(signal.shift.centres_px[:, i]) for i in (0, 1))
    picture = np.full((len(rows), len(columns), 2), np.nan)
    at = (
        np.searchsorted(rows, signal.shift.centres_px[:, 1]),
        np.searchsorted(columns, signal.shift.centres_px[:, 0]),
    )
    picture[at] = signal.shift.displacement_px
    found = [np.abs(np.diff(picture, 2, axis=a)).ravel() for a in (0, 1) if picture.shape[a] > 2]
    step_px = signal.noise.window_px * signal.shift.stride
    values = np.concatenate(found) if found else np.zeros(1)
    return float(np.nanpercentile(values, 99)) / step_px**2 if np.isfinite(values).any() else 0.0


_CELLS = (32, 48, 64, 96)


def _grid(scene: Scene, flow: ExpectedFlow) -> Choice:
    """Trilinear cells lose their curvature: rms of h^2 / 8 times the second differences across the view."""
    departure = flow.excess_k - flow.excess_k.mean(axis=(0, 1))
    size = float(departure.std())
    lost = [np.diff(departure, 2, axis=a)[1:-1, 1:-1, 1:-1] / 8 for a in (0, 2)]
    vertices = max(flow.grid.shape)
    at_expected = float(np.sqrt(np.mean(sum(np.mean(part**2) for part in lost))))
    given = scene.solve.grid
    bounds: dict[int, float] = {
        n: at_expected * ((vertices - 1) / n) ** 2 for n in (_CELLS if given == "auto" else (given,))
    }
    value = next((n for n, bound in bounds.items() if bound <= SHARE * size), max(bounds))
    return Choice(
        "grid", value, bounds[value], SHARE * size, "K", (value / _CELLS[-1]) ** 3,
        "what trilinear cells of this size lose of the expected flow, against a tenth of its departures",
    )  # fmt: skip


def _transport(scene: Scene, flow: ExpectedFlow) -> Choice:
    """Turbulent where the supply's Reynolds number or the room's Rayleigh number says so."""
    given = scene.flow.transport
    air, room = scene.air, scene.room
    reynolds = [
        float(np.linalg.norm(b.velocity_m_s)) * _patch_edge_m(b) / air.kinematic_viscosity_m2_s
        for b in scene.boundary
        if isinstance(b, Inlet)
    ]
    contrast = float(np.abs(flow.excess_k).max())
    diffusivity = air.kinematic_viscosity_m2_s / air.prandtl
    rayleigh = 9.81 * contrast / air.ambient_temperature_k * room.size_m[2] ** 3
    rayleigh /= air.kinematic_viscosity_m2_s * diffusivity
    turbulent = max(reynolds, default=0.0) > _LAMINAR_RE or rayleigh > _LAMINAR_RA
    value = ("k_epsilon" if turbulent else "molecular") if given == "auto" else given
    fastest = max(reynolds, default=0.0)
    reason = f"Re {fastest:.2g}, Ra {rayleigh:.2g}; turbulent above {_LAMINAR_RE:g} or {_LAMINAR_RA:g}"
    return Choice("transport", value, 0.0, 0.0, "", 1.0 if turbulent else 0.6, reason)


# A plane jet and a heated cavity are unsteady from about these on (Schlichting; Paolucci 1990).
_LAMINAR_RE, _LAMINAR_RA = 1000.0, 1e8


def _patch_edge_m(inlet: Inlet) -> float:
    sides = [u - low for low, u in zip(inlet.patch.lower_m, inlet.patch.upper_m, strict=True)]
    return float(np.sqrt(np.prod(sides)))
