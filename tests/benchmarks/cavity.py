"""The heated cavity of de Vahl Davis (1983), Ra 1e3 to 1e5: mean Nusselt number of the grid and a network.

The network's residuals come by propagated derivatives, on a fixed set of points, and are solved by Levenberg and
Marquardt's steps with a dense Jacobian: AdaBelief takes thousands of steps, and a network's columns are so nearly
dependent that conjugate gradients do not get through (Nu 0.99 at Ra 1e3). One JSON line each.
"""

import argparse
import json
import time

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from core.boussinesq import Flow, Numbers, residuals
from core.mlp import Mlp, MlpSettings, initial_mlp
from tests.core.solve.cavity import NUSSELT, at_rest, mean_heat_flux, numbers, solve

WALL = 10.0
# Points inside and along a wall, Re, Pe.
Given = tuple[Array, Array, Array, Array]


def in_plane(points_xz: Array) -> Array:
    """Points of the plane y = 1/2."""
    return jnp.stack([points_xz[:, 0], jnp.full_like(points_xz[:, 0], 0.5), points_xz[:, 1]], axis=1)


def flat(found: tuple[Flow, Flow, Flow]) -> tuple[Flow, Flow, Flow]:
    """Two-dimensional: no velocity along y, and nothing changes along it."""
    value, slope, laplacian = found
    still, still_slope = jnp.array([1.0, 0.0, 1.0]), jnp.array([1.0, 0.0, 1.0])
    return (
        Flow(value.temperature, value.pressure, value.velocity * still[None]),
        Flow(
            slope.temperature * still_slope[None],
            slope.pressure * still_slope[None],
            slope.velocity * still[None, :, None] * still_slope[None, None],
        ),
        Flow(laplacian.temperature, laplacian.pressure, laplacian.velocity * still[None]),
    )


def rows(network: Mlp, data: Given) -> tuple[Array, ...]:
    """Residuals at the points, walls, and the mean of p."""
    inside, along, reynolds, peclet = data
    given = Numbers(reynolds=reynolds, peclet=peclet, richardson=1.0)
    value, slope, laplacian = flat(network.with_derivatives(inside))
    left = jax.vmap(residuals, (0, 0, 0, None))(value, slope, laplacian, given)
    each = inside.shape[0] ** -0.5
    wall = WALL * along.shape[0] ** -0.5
    zero, one = jnp.zeros_like(along), jnp.ones_like(along)
    sides = [
        in_plane(jnp.stack(p, axis=1)) for p in ((zero, along), (one, along), (along, zero), (along, one))
    ]
    hot, cold = (network.at(side) for side in sides[:2])
    floor, ceiling = (flat(network.with_derivatives(side)) for side in sides[2:])
    speeds = [f.velocity[:, jnp.array([0, 2])] for f in (hot, cold, floor[0], ceiling[0])]
    return (
        each * left.mass,
        each * left.momentum,
        each * left.heat,
        wall * (hot.temperature - 0.5),
        wall * (cold.temperature + 0.5),
        wall * floor[1].temperature[:, 2],
        wall * ceiling[1].temperature[:, 2],
        *(wall * speed for speed in speeds),
        value.pressure.mean(),
    )


def start(width: int) -> Mlp:
    """A network that knows no y."""
    settings = MlpSettings(hidden_layers=3, width=width)
    network = initial_mlp(settings, (0.0,) * 3, (1.0,) * 3, jax.random.key(0), jnp.float64)
    first = network.weights[0].at[1].set(0.0)
    return Mlp((first, *network.weights[1:]), network.biases, None, (0.0,) * 3, (1.0,) * 3, "tanh")


@eqx.filter_jit
def normal_equations(network: Mlp, data: Given) -> tuple[Array, Array, Array]:
    """J^T J, J^T r and r^T r, a slice of columns at a time."""
    flat, unravel = jax.flatten_util.ravel_pytree(network)

    def residual(z: Array) -> Array:
        return jax.flatten_util.ravel_pytree(rows(unravel(z), data))[0]

    value, product = jax.linearize(residual, flat)
    columns = jax.lax.map(product, jnp.eye(flat.size, dtype=flat.dtype), batch_size=32)
    return columns @ columns.T, columns @ value, value @ value


@eqx.filter_jit
def square(network: Mlp, data: Given) -> Array:
    """r^T r."""
    value = jax.flatten_util.ravel_pytree(rows(network, data))[0]
    return value @ value


def descended(network: Mlp, data: Given, steps: int) -> tuple[Mlp, float]:
    """Levenberg-Marquardt; the network and its loss."""
    damping, cost = 1e-3, float(square(network, data))
    for _ in range(steps):
        hessian, gradient, _ = (np.asarray(a) for a in normal_equations(network, data))
        flat, unravel = jax.flatten_util.ravel_pytree(network)
        before = cost
        for _ in range(8):
            move = np.linalg.solve(hessian + damping * np.eye(len(hessian)), gradient)
            tried = unravel(flat - move)
            after = float(square(tried, data))
            if after < cost:
                network, cost, damping = tried, after, max(damping / 5, 1e-13)
                break
            damping *= 4
        if cost > (1 - 1e-3) * before:
            break
    return network, cost


def network_nusselts(width: int, points: int, steps: int) -> list[dict]:
    """One Rayleigh number starting from the other."""
    # Denser at the walls, where the boundary layers are.
    line = 0.5 - 0.5 * jnp.cos(jnp.pi * (jnp.arange(float(points)) + 0.5) / points)
    inside = in_plane(jnp.stack([m.ravel() for m in jnp.meshgrid(line, line, indexing="ij")], axis=1))
    network, found = start(width), []
    for rayleigh in NUSSELT:
        began, given = time.process_time(), numbers(rayleigh)
        data = (inside, line, jnp.asarray(given.reynolds), jnp.asarray(given.peclet))
        network, cost = descended(network, data, steps)
        even = (jnp.arange(40.0) + 0.5) / 40
        where = in_plane(jnp.stack([m.ravel() for m in jnp.meshgrid(even, even, indexing="ij")], axis=1))
        value, slope, _ = jax.jit(lambda n, p: n.with_derivatives(p))(network, where)
        flux = given.peclet * value.velocity[:, 0] * value.temperature - slope.temperature[:, 0]
        found.append(line_of("mlp", width, rayleigh, float(flux.mean()), began))
        found[-1]["loss"] = cost
        print(json.dumps(found[-1]), flush=True)
    return found


def line_of(method: str, size: int, rayleigh: float, nusselt: float, began: float) -> dict:
    """One line of the table."""
    return {
        "method": method,
        "size": size,
        "rayleigh": rayleigh,
        "nusselt": round(nusselt, 4),
        "published": NUSSELT[rayleigh],
        "error": round(nusselt / NUSSELT[rayleigh] - 1, 5),
        "cpu_s": round(time.process_time() - began, 1),
    }


def main() -> None:
    """Print one JSON line a Rayleigh number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", choices=("grid", "mlp"), default="grid")
    parser.add_argument("--cells", type=int, default=64)
    parser.add_argument("--width", type=int, default=24)
    parser.add_argument("--points", type=int, default=24)
    parser.add_argument("--steps", type=int, default=60)
    options = parser.parse_args()
    with jax.enable_x64(True):
        if options.method == "mlp":
            network_nusselts(options.width, options.points, options.steps)
            return
        cavity = at_rest(options.cells)
        for rayleigh in NUSSELT:
            began = time.process_time()
            cavity = solve(cavity, rayleigh)
            flux = float(mean_heat_flux(cavity, numbers(rayleigh).peclet))
            print(json.dumps(line_of("grid", options.cells, rayleigh, flux, began)), flush=True)


if __name__ == "__main__":
    main()
