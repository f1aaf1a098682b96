"""Every `auto` resolved: the cheapest choice whose bound stays below a stated share of the noise."""

from dataclasses import dataclass, replace

import numpy as np

from core.plan.choice import Choice
from core.plan.expected import ExpectedFlow
from core.plan.flow_choices import grid, transport
from core.plan.picture_choices import aperture, data_term, precision, window
from core.plan.print_choice import finest_period
from core.plan.ray_choices import irradiance, probe_of, projector_order, tracer_of, tracing
from core.plan.signal import Signal
from core.scene import FixedTexture, ProjectedPattern, Scene
from core.view_frame import facing


@dataclass(frozen=True)
class Resolution:
    """The scene with its `auto` values settled, and why."""

    scene: Scene
    choices: tuple[Choice, ...]


def resolve(scene: Scene, flow: ExpectedFlow, signals: tuple[Signal, ...]) -> Resolution:
    """Settle every `auto` of the scene for this flow and this noise; given values are kept and judged."""
    view = int(np.argmin([s.noise.mean_px for s in signals]))
    signal = signals[view]
    probe = probe_of(scene, view, flow, signal)
    cells, closure = grid(scene, flow), transport(scene, flow)
    kind, steps, made = tracing(probe, cells.value)
    rays = replace(scene.rays, tracer=kind, steps=steps)
    if isinstance(scene.light, ProjectedPattern):
        tracer = tracer_of(kind, steps, scene)
        order, lit = projector_order(probe, tracer), irradiance(probe, signal, tracer)
        rays = replace(rays, projector_order=order.value, irradiance=lit.value)
        made += [order, lit]
    if isinstance(scene.light, FixedTexture):
        made.append(finest_period(scene.light, scene))
    cone, data = aperture(*facing(scene, view), signal), data_term(scene, view, signal)
    settled = replace(
        scene,
        rays=replace(rays, aperture_cone=cone.value),
        solve=replace(scene.solve, grid=cells.value, data_term=data.value),
        flow=replace(scene.flow, transport=closure.value),
    )
    return Resolution(settled, (*made, cone, data, window(signal), precision(signal), cells, closure))
