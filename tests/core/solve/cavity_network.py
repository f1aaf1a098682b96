"""The heated cavity by the implicit representation: its residuals at Gauss points, solved by Levenberg and Marquardt.

A row asks one point, so its slope by every weight of the network comes backwards from that point alone: the whole
dense Jacobian costs what some twenty evaluations cost, where a column at a time it took one for each weight.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from core.losses.boussinesq import FlowValues, Numbers, residuals
from core.mlp import Mlp, MlpSettings, initial_mlp

# Weight of a wall's errors over the residuals' within. With 10 the walls hide the equations for a hundred steps.
WALL = 3.0
_ALONG_XZ = jnp.array([0, 2])

Points = Float[Array, "points 3"]
AtPoint = Callable[[Mlp, Float[Array, "3"], Numbers], Float[Array, " rows"]]


class Term(eqx.Module):
    """Rows at points, each over the square root of its share of the area or of the wall."""

    at: AtPoint = eqx.field(static=True)
    points: Points
    weight: Float[Array, " points"]


def flow_at(network: Mlp, points: Points) -> tuple[FlowValues, FlowValues, FlowValues]:
    """Values, slopes, Laplacians of a flow without velocity along y, the network being one that knows no y."""
    value, slope, laplacian = network.with_derivatives(points)
    still = jnp.array([1.0, 0.0, 1.0])
    return (
        FlowValues(value.temperature, value.pressure, value.velocity * still[None]),
        FlowValues(slope.temperature, slope.pressure, slope.velocity * still[None, :, None]),
        FlowValues(laplacian.temperature, laplacian.pressure, laplacian.velocity * still[None]),
    )


def start(width: int) -> Mlp:
    """Three hidden layers that know no y."""
    settings = MlpSettings(hidden_layers=3, width=width)
    network = initial_mlp(settings, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), jax.random.key(0), jnp.float64)
    first = network.weights[0].at[1].set(0.0)
    return eqx.tree_at(lambda n: n.weights[0], network, first)


def cavity_terms(points: int) -> tuple[Term, ...]:
    """Equations within, a temperature on two walls, insulation on two, and one value of p."""
    line, share = _gauss(points)
    low, high = jnp.zeros_like(line), jnp.ones_like(line)
    x, z = (m.ravel() for m in jnp.meshgrid(line, line, indexing="ij"))
    walls = WALL * jnp.tile(share, 2) ** 0.5
    sides = jnp.concatenate([_in_plane(low, line), _in_plane(high, line)])
    floors = jnp.concatenate([_in_plane(line, low), _in_plane(line, high)])
    return (
        Term(_equations, _in_plane(x, z), jnp.outer(share, share).ravel() ** 0.5),
        Term(_heated_wall, sides, walls),
        Term(_insulated_wall, floors, walls),
        Term(_pressure, _in_plane(jnp.full(1, 0.5), jnp.full(1, 0.5)), jnp.ones(1)),
    )


def descended(network: Mlp, terms: tuple[Term, ...], given: Numbers, steps: int) -> tuple[Mlp, float]:
    """The network after so many steps that lower its loss, or when none does; and the loss."""
    damping = 1e-3
    # As an array: one program for all Rayleigh numbers.
    transport = jnp.array([given.reynolds, given.peclet])
    cost = float(_loss(network, terms, transport))
    for _ in range(steps):
        normal, slope = (np.asarray(a) for a in _normal_equations(network, terms, transport))
        flat, unravel = jax.flatten_util.ravel_pytree(network)
        for _ in range(10):
            try:
                factor = cho_factor(normal + damping * np.eye(len(normal)))
            except LinAlgError:
                damping *= 4
                continue
            tried = unravel(flat - cho_solve(factor, slope))
            after = float(_loss(tried, terms, transport))
            if after < cost:
                network, cost, damping = tried, after, max(damping / 4, 1e-13)
                break
            damping *= 4
        else:
            break
    return network, cost


def nusselt(network: Mlp, given: Numbers) -> float:
    """Mean over the cavity of Pe u T - dT/dx, by a finer Gauss rule than the network was fitted at."""
    line, share = _gauss(40)
    x, z = (m.ravel() for m in jnp.meshgrid(line, line, indexing="ij"))
    value, slope, _ = jax.jit(flow_at)(network, _in_plane(x, z))
    flux = given.peclet * value.velocity[:, 0] * value.temperature - slope.temperature[:, 0]
    return float(jnp.outer(share, share).ravel() @ flux)


def _gauss(points: int) -> tuple[Float[Array, " points"], Float[Array, " points"]]:
    """Gauss and Legendre's points of 0 to 1 and their weights; close together where the layers are."""
    at, weight = np.polynomial.legendre.leggauss(points)
    return jnp.asarray(0.5 + 0.5 * at), jnp.asarray(0.5 * weight)


def _in_plane(x: Float[Array, " points"], z: Float[Array, " points"]) -> Points:
    return jnp.stack([x, jnp.full_like(x, 0.5), z], axis=1)


def _equations(network: Mlp, point: Float[Array, "3"], given: Numbers) -> Float[Array, "4"]:
    left = jax.vmap(residuals, (0, 0, 0, None))(*flow_at(network, point[None]), given)
    return jnp.concatenate([left.mass, left.momentum[0, _ALONG_XZ], left.heat])


def _heated_wall(network: Mlp, point: Float[Array, "3"], given: Numbers) -> Float[Array, "3"]:
    found = network.at(point[None])
    return jnp.concatenate([found.temperature - (0.5 - point[:1]), found.velocity[0, _ALONG_XZ]])


def _insulated_wall(network: Mlp, point: Float[Array, "3"], given: Numbers) -> Float[Array, "3"]:
    value, slope, _ = flow_at(network, point[None])
    return jnp.concatenate([slope.temperature[:, 2], value.velocity[0, _ALONG_XZ]])


def _pressure(network: Mlp, point: Float[Array, "3"], given: Numbers) -> Float[Array, "1"]:
    return network.at(point[None]).pressure


def _of(transport: Float[Array, "2"]) -> Numbers:
    return Numbers(reynolds=transport[0], peclet=transport[1], richardson=1.0)


@eqx.filter_jit
def _loss(network: Mlp, terms: tuple[Term, ...], transport: Float[Array, "2"]) -> Float[Array, ""]:
    given = _of(transport)
    rows = [t.weight[:, None] * jax.vmap(t.at, (None, 0, None))(network, t.points, given) for t in terms]
    return jnp.stack([(row**2).sum() for row in rows]).sum()


@eqx.filter_jit
def _normal_equations(
    network: Mlp, terms: tuple[Term, ...], transport: Float[Array, "2"]
) -> tuple[Float[Array, "weights weights"], Float[Array, " weights"]]:
    """J^T J and J^T r."""
    given = _of(transport)
    flat, unravel = jax.flatten_util.ravel_pytree(network)
    normal, slope = jnp.zeros((flat.size, flat.size)), jnp.zeros(flat.size)
    for term in terms:

        def row(z: Array, point: Array, term: Term = term) -> Array:
            return term.at(unravel(z), point, given)

        value = jax.vmap(row, (None, 0))(flat, term.points) * term.weight[:, None]
        jacobian = jax.vmap(jax.jacrev(row), (None, 0))(flat, term.points) * term.weight[:, None, None]
        jacobian = jacobian.reshape(-1, flat.size)
        normal, slope = normal + jacobian.T @ jacobian, slope + jacobian.T @ value.ravel()
    return normal, slope
