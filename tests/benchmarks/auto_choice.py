"""Is what `auto` settles right, and is it cheap? Ten scenes against a sweep of ray model, steps and order.

    python -m tests.benchmarks.auto_choice

One JSON line a scene: the choice, its largest difference from the dearest model over every window in parts
of a window's noise, and its cost over that of the cheapest admissible choice. Admissible: no window differs
by more than the share of the noise that a choice may cost, with a step a cell of the answer's grid or more.
Cost: operations of the compiled trace.
"""

import json
import time
from collections.abc import Callable, Iterator
from functools import partial

from app.bench.parts.ray_sweep import DEAREST_ORDER, DEAREST_STEPS, KINDS, Traced, traced
from core.plan.choice import SHARE
from core.plan.choices import resolve
from core.plan.expected import expected_flow
from core.plan.shift_noise import shift_noise
from core.plan.signal import signal
from core.problem import Problem
from core.scene import ProjectedPattern
from tests.core.plan.scenes import SCENES, WINDOW_PX, named

STEPS = (32, 40, 48, 64, 96, 128, 192, 256)


def judged(name: str) -> dict[str, object]:
    """One scene: `auto` beside every choice of the sweep."""
    scene, excess_k = named(name)
    flow = expected_flow(Problem(scene, ()), excess_k)
    found = signal(scene, 0, flow, shift_noise(scene, 0, WINDOW_PX))
    began = time.process_time()
    settled = resolve(scene, flow, (found,)).scene
    resolve_s = time.process_time() - began
    rays, cells = settled.rays, int(settled.solve.grid)
    projected = isinstance(scene.light, ProjectedPattern)
    orders = (1, 2, DEAREST_ORDER) if projected else (1,)
    trace = partial(traced, scene, flow.field(scene.air), found.shift.centres_px)
    exact = trace("nonlinear", DEAREST_STEPS, orders[-1])

    def off(one: Traced) -> float:
        return one.off_px(exact) / found.noise.mean_px

    own = trace(rays.tracer, int(rays.steps), int(rays.projector_order) if projected else 1)
    admissible = list(_admissible(trace, [n for n in STEPS if n >= cells], orders, off))
    cheapest = min(admissible, key=lambda choice: choice[0], default=None)
    return {
        "scene": name, "excess_K": excess_k, "noise_px": found.noise.mean_px,
        "auto": [rays.tracer, rays.steps, rays.projector_order if projected else None],
        "off_by_noise": off(own), "resolve_cpu_s": round(resolve_s, 2),
        "cheapest": cheapest and cheapest[1], "cost": cheapest and own.operations / cheapest[0],
    }  # fmt: skip


def _admissible(
    trace: Callable[[str, int, int], Traced],
    counts: list[int],
    orders: tuple[int, ...],
    off: Callable[[Traced], float],
) -> Iterator[tuple[float, list[object]]]:
    """Per model and order the fewest steps that serve, as the next more do: two errors may cancel at one."""
    for kind in KINDS:
        for order in orders:
            held = None
            for steps in counts:
                one = trace(kind, steps, order)
                if off(one) > SHARE:
                    held = None
                elif held is None:
                    held = one.operations, [kind, steps, order if len(orders) > 1 else None]
                else:
                    yield held
                    break


def main() -> None:
    """Print the rows."""
    for name in SCENES:
        print(json.dumps(judged(name)), flush=True)


if __name__ == "__main__":
    main()
