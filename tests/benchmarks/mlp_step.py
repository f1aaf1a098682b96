"""One step of the physics loss of a network: propagated derivatives against nested forward ones.

CPU seconds of loss and gradient, both in one run, with the largest difference of the gradients beside.
"""

import argparse
import json
import time

import jax
import jax.numpy as jnp

from core.losses.boussinesq import FlowValues, Numbers, residuals
from core.mlp import Mlp, MlpSettings, initial_mlp
from tests.benchmarks.options import whole_numbers

NUMBERS = Numbers(reynolds=1790.0, peclet=1516.0, richardson=4.02)


def nested(network: Mlp, points):
    """Value, Jacobian and trace of the Hessian at each point by forward-over-forward differentiation."""

    def one(point):
        flow = network.at(point[None])
        return FlowValues(flow.temperature[0], flow.pressure[0], flow.velocity[0])

    def laplacian(point):
        hessian = jax.jacfwd(jax.jacfwd(one))(point)
        return jax.tree.map(lambda h: jnp.trace(h, axis1=-2, axis2=-1), hessian)

    return jax.vmap(one)(points), jax.vmap(jax.jacfwd(one))(points), jax.vmap(laplacian)(points)


def loss(network: Mlp, points, derivatives):
    """Mean squared residuals."""
    left = jax.vmap(residuals, (0, 0, 0, None))(*derivatives(network, points), NUMBERS)
    return sum((r**2).mean() for r in (left.mass, left.momentum, left.heat))


def measure(function, *arguments, repeats: int):
    """CPU seconds a call, compile time apart."""
    start = time.perf_counter()
    value = jax.block_until_ready(function(*arguments))
    compile_s = time.perf_counter() - start
    start = time.process_time()
    for _ in range(repeats):
        jax.block_until_ready(function(*arguments))
    return value, (time.process_time() - start) / repeats, compile_s


def main() -> None:
    """Print one JSON line for each way and one for the ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    whole_numbers(parser, points=8192, layers=4, width=128, repeats=5)
    options = parser.parse_args()
    settings = MlpSettings(hidden_layers=options.layers, width=options.width)
    network = initial_mlp(settings, (0.0, 0.0, 0.0), (1.4, 1.0, 1.0), jax.random.key(0))
    points = jax.random.uniform(jax.random.key(1), (options.points, 3))
    found = {}
    for name, derivatives in (("propagated", Mlp.with_derivatives), ("nested_forward", nested)):
        step = jax.jit(jax.value_and_grad(lambda n, p, d=derivatives: loss(n, p, d)))
        (_, gradient), cpu_s, compile_s = measure(step, network, points, repeats=options.repeats)
        found[name] = (gradient, cpu_s)
        print(json.dumps({"method": name, "cpu_s": round(cpu_s, 4), "compile_s": round(compile_s, 2)}))
    leaves = [jax.tree.leaves(found[name][0]) for name in found]
    error = max(float(jnp.abs(a - b).max() / jnp.abs(b).max()) for a, b in zip(*leaves, strict=True))
    ratio = found["propagated"][1] / found["nested_forward"][1]
    print(json.dumps({"ratio": round(ratio, 3), "gradient_difference": error}))


if __name__ == "__main__":
    main()
