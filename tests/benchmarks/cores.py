"""What a second core adds to rays: python -m tests.benchmarks.cores [--cores 2].

Wall seconds of the same work by a process held to one core and by one held to several, on a quiet
machine: 40,000 rays, 64 steps, 64^3 vertices; 12,100 windows of the straight-ray operator. One JSON line a
piece of work. Linux only.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable

WINDOWS, RAYS, STEPS = 110 * 110, 40_000, 64


def wall_s(function: Callable, *arguments: object) -> float:
    import jax

    jax.block_until_ready(function(*arguments))
    times = []
    for _ in range(7):
        start = time.perf_counter()
        jax.block_until_ready(function(*arguments))
        times.append(time.perf_counter() - start)
    return min(times)


def measure(cores: int) -> None:
    """Runs in a process of its own: a runtime counts its cores once, when it starts."""
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])
    import equinox as eqx
    import jax.numpy as jnp

    from app.bench.parts import operator_trade, ray_trade

    field, rays = ray_trade.single(ray_trade.grid64(10.0)), ray_trade.single(ray_trade.bundle(30.0, RAYS))
    found = {}
    for name, kind in ray_trade.TRACERS.items():
        tracer = kind(STEPS, ray_trade.AIR.ambient_refractivity)
        found[f"{name} forward"] = RAYS / wall_s(ray_trade.bend, tracer, rays, field)
        found[f"{name} gradient"] = RAYS / wall_s(ray_trade.gradient, tracer, rays, field)
    operator = operator_trade.windows_operator(30.0)
    apply, transpose = eqx.filter_jit(lambda o, v: o.apply(v)), eqx.filter_jit(lambda o, d: o.transpose(d))
    seen = jnp.ones((WINDOWS, 2), jnp.float32)
    found["operator forward"] = WINDOWS / wall_s(apply, operator, field.values)
    found["operator transpose"] = WINDOWS / wall_s(transpose, operator, seen)
    print(json.dumps(found))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--here", type=int)
    asked = parser.parse_args()
    if asked.here:
        measure(asked.here)
        return
    command = [sys.executable, "-m", "tests.benchmarks.cores", "--here"]
    one, many = (
        json.loads(subprocess.run([*command, str(n)], check=True, capture_output=True, text=True).stdout)
        for n in (1, asked.cores)
    )
    for work, speed in one.items():
        row = {"work": work, "rays_per_s_1": round(speed), f"rays_per_s_{asked.cores}": round(many[work])}
        print(json.dumps(row | {"gain": round(many[work] / speed, 2)}))


if __name__ == "__main__":
    main()
