"""What a traced ray costs and the error that it bought: the rows of `airlens bench rays`.

Times are CPU seconds of this process, so that a busy machine does not change them much. Error: relative L2 of
the wall shift against float64 (`exact_wall_shift_m`; for the trilinear grid, whose gradient jumps, 4096
steps of leapfrog). Memory: what the compiled gradient of 100 x 100 px x 4 samples needs.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from core.air import Air
from core.fields import AbstractField, FunctionField, GridField, plume
from core.geometry import Box
from core.rays import AbstractRayTracer, NonlinearTracer, QuasiLinearTracer, Rays, StraightTracer
from core.rays.yardstick import exact_wall_shift_m

Tree = TypeVar("Tree", bound=PyTree)
ROOM = Box(lower_m=(-1.2, -1.5, 0.0), upper_m=(2.9, 1.5, 3.0))
AIR = Air()
TRACERS = {"straight": StraightTracer, "quasi_linear": QuasiLinearTracer, "nonlinear": NonlinearTracer}
CONTRASTS_K, STAND_OFFS_M = (0.01, 10.0, 300.0, 1500.0), (3.0, 30.0, 300.0)
_ERROR_RAYS, _MEMORY_RAYS = 400, 40_000


@dataclass(frozen=True, kw_only=True)
class RayRow:
    """One line of the trade."""

    field: str
    tracer: str
    dT_K: float  # noqa: N815 - the record's agreed name
    stand_off_m: float
    steps: int
    dtype: str
    rel_error: float
    forward_rays_per_s: float
    gradient_rays_per_s: float
    peak_memory_mb: float

    def as_dict(self) -> dict[str, str | float]:
        """The row as JSON's object."""
        return asdict(self)


class _Network(eqx.Module):
    """A room's temperature from a 4 x 128 network: smooth, without rest at the walls."""

    mlp: eqx.nn.MLP
    excess_k: Float[Array, ""]

    def __call__(self, point_m: Float[Array, "3"]) -> Float[Array, ""]:
        share = jax.nn.sigmoid(2.0 * self.mlp(point_m - 1.0))
        return AIR.excess_refractivity(self.excess_k * share)


def _plume(excess_k: float) -> AbstractField:
    return plume(AIR, peak_k=jnp.asarray(excess_k), centre_m=(0.85, 0.0, 1.5), radius_m=0.25)


def grid64(excess_k: float) -> GridField:
    """The plume on 64^3 vertices of the room."""
    axes = [np.linspace(low, u, 64) for low, u in zip(ROOM.lower_m, ROOM.upper_m, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    values = _plume(excess_k).excess(jnp.asarray(points, jnp.float32))
    return GridField(ROOM.lower_m, ROOM.upper_m, values.reshape(64, 64, 64))


def _network(excess_k: float) -> AbstractField:
    mlp = eqx.nn.MLP(3, "scalar", 128, 4, jnp.tanh, dtype=jnp.float32, key=jax.random.key(0))
    return FunctionField(_Network(mlp, jnp.asarray(excess_k, jnp.float32)))


# Field and the number of rays that its time is taken from.
FIELDS: dict[str, tuple[Callable[[float], AbstractField], int]] = {
    "plume": (_plume, 10_000),
    "grid64": (grid64, 10_000),
    "network4x128": (_network, 200),
}


def ray_rows(
    fields: tuple[str, ...],
    contrasts_k: tuple[float, ...],
    stand_offs_m: tuple[float, ...],
    steps: tuple[int, ...],
) -> Iterator[RayRow]:
    """Every combination; a time belongs to field, tracer and steps, and is taken once for them."""
    for name in fields:
        make, rays = FIELDS[name]
        exact = {(k, s): _exact(make(k), s) for k in contrasts_k for s in stand_offs_m}
        for tracer_name, kind in TRACERS.items():
            for count in steps:
                tracer = kind(count, AIR.ambient_refractivity)
                speed = _speed(tracer, make(10.0), rays)
                for (excess_k, stand_off_m), expected in exact.items():
                    found = bend(tracer, single(bundle(stand_off_m, _ERROR_RAYS)), single(make(excess_k)))
                    error = np.linalg.norm(np.asarray(found) - expected) / np.linalg.norm(expected)
                    yield RayRow(
                        field=name, tracer=tracer_name, dT_K=excess_k, stand_off_m=stand_off_m, steps=count,
                        dtype="float32", rel_error=float(error), forward_rays_per_s=speed[0],
                        gradient_rays_per_s=speed[1], peak_memory_mb=speed[2],
                    )  # fmt: skip


def bundle(stand_off_m: float, count: int) -> Rays:
    """Rays to seeded points behind the middle of the room, float64."""
    rng = np.random.default_rng(0)
    points_m = np.stack([rng.uniform(0, 1.7, count), np.full(count, 1.5), rng.uniform(0.6, 2.4, count)], 1)
    origin_m = np.array([0.85, 1.5 - stand_off_m, 1.5])
    reach_m = np.linalg.norm(points_m - origin_m, axis=1)
    direction = (points_m - origin_m) / reach_m[:, None]
    # The middle of the wall is reached through the front, or from a camera on it.
    inside_m = np.minimum(3.0 / direction[:, 1], reach_m)
    with jax.enable_x64(True):
        return Rays(
            jnp.asarray(points_m - direction * inside_m[:, None]), jnp.asarray(direction),
            jnp.asarray(inside_m), jnp.zeros(count, jnp.int32),
        )  # fmt: skip


def single(tree: Tree) -> Tree:
    """The same with float32 arrays."""
    return jax.tree.map(
        lambda a: jnp.asarray(np.asarray(a), jnp.float32) if eqx.is_inexact_array(a) else a, tree
    )


def _exact(field: AbstractField, stand_off_m: float) -> Float[np.ndarray, "rays 3"]:
    with jax.enable_x64(True):
        wide = jax.tree.map(
            lambda a: jnp.asarray(np.asarray(a, float)) if eqx.is_inexact_array(a) else a, field
        )
        rays = bundle(stand_off_m, _ERROR_RAYS)
        if isinstance(field, GridField):
            return np.asarray(bend(NonlinearTracer(4096, AIR.ambient_refractivity), rays, wide))
        return exact_wall_shift_m(rays, wide, AIR.ambient_refractivity)


@eqx.filter_jit
def bend(tracer: AbstractRayTracer, rays: Rays, field: AbstractField) -> Float[Array, "rays 3"]:
    """Wall shift [m], compiled."""
    return tracer.bend(rays, field).wall_shift_m


@eqx.filter_jit
def gradient(tracer: AbstractRayTracer, rays: Rays, field: AbstractField) -> tuple[Array, AbstractField]:
    """A quadratic loss of the wall shift and its gradient in the field, compiled."""
    return eqx.filter_value_and_grad(lambda f: 1e6 * jnp.sum(tracer.bend(rays, f).wall_shift_m ** 2))(field)


def _speed(tracer: AbstractRayTracer, field: AbstractField, count: int) -> tuple[float, float, float]:
    """Rays per CPU second, forward and with gradient, and the memory of a large gradient [MB]."""
    field, rays = single(field), single(bundle(30.0, count))
    size = _gradient_bytes(tracer, single(bundle(30.0, _MEMORY_RAYS)), field)
    forward, backward = (cpu_s(f, tracer, rays, field) for f in (bend, gradient))
    return count / forward, count / backward, size / 1e6


def _gradient_bytes(tracer: AbstractRayTracer, rays: Rays, field: AbstractField) -> int:
    """Memory of the compiled gradient: arguments, results and everything between."""
    moving, still = eqx.partition(field, eqx.is_inexact_array)

    def loss(values: AbstractField) -> Array:
        return jnp.sum(tracer.bend(rays, eqx.combine(values, still)).wall_shift_m ** 2)

    memory = jax.jit(jax.value_and_grad(loss)).lower(moving).compile().memory_analysis()
    names = ("temp", "output", "argument")
    sizes = [getattr(memory, f"{name}_size_in_bytes") for name in names]
    return sum(sizes) + sum(leaf.nbytes for leaf in jax.tree.leaves(rays))


def cpu_s(function: Callable, *arguments: object) -> float:
    """Least CPU time of five runs after one that compiles."""
    jax.block_until_ready(function(*arguments))
    best = np.inf
    for _ in range(5):
        start = time.process_time()
        jax.block_until_ready(function(*arguments))
        best = min(best, time.process_time() - start)
    return float(best)
