"""The paper's three losses (section II-D) as weighted rows: the loss is the sum of their squares.

Rows rather than a scalar, so that a Gauss-Newton method can use the same losses as a gradient method.
Each `rows` takes a key for a random mini-batch, or None for everything. A regime is a list of losses.
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from core.losses.boussinesq import FlowValues, Numbers
from core.losses.representation import Fields, Spans, Unknowns, points_of

Rows = tuple[Float[Array, "..."], ...]


@runtime_checkable
class Loss(Protocol):
    """One term of the objective."""

    @property
    def name(self) -> str:
        """As in the paper: bos, boundary, pde; others as they are."""
        ...

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """Weighted residuals whose squares sum to the loss."""
        ...


class PhysicsLoss(eqx.Module):
    """λ3 times the mean over points of γ1 mass² + γ2 |momentum|² + γ3 heat²."""

    numbers: Numbers = eqx.field(static=True)
    lower: tuple[float, float, float] = eqx.field(static=True)
    upper: tuple[float, float, float] = eqx.field(static=True)
    weight: float = eqx.field(static=True, default=1.0)
    gamma: tuple[float, float, float] = eqx.field(static=True, default=(1.0, 1.0, 1.0))
    points: int = eqx.field(static=True, default=8192)
    name: str = eqx.field(static=True, default="pde")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """Mass, momentum, heat."""
        points = None
        if key is not None:
            lower, upper = jnp.array(self.lower)[None], jnp.array(self.upper)[None]
            points = lower + (upper - lower) * jax.random.uniform(key, (self.points, 3))
        left = fields.residuals(self.numbers, points)
        per_point = self.weight / left.mass.shape[0]
        return tuple(
            (gamma * per_point) ** 0.5 * part
            for gamma, part in zip(self.gamma, (left.mass, left.momentum, left.heat), strict=True)
        )

    def with_batch(self, points: int) -> "PhysicsLoss":
        """The same on mini-batches of `points`."""
        return dataclasses.replace(self, points=points)


class KnownValues(eqx.Module):
    """Known values on a tensor grid of points; with `minus`, known differences to a second one.

    `weight` is zero where a field is not known.
    """

    spans: Spans = eqx.field(static=True)
    target: FlowValues
    weight: FlowValues
    minus: Spans | None = eqx.field(static=True, default=None)


class BoundaryLoss(eqx.Module):
    """λ2 times the mean over the boundary points of the squared, weighted error of T, p, u."""

    patches: tuple[KnownValues, ...]
    weight: float = eqx.field(static=True, default=1.0)
    points: int = eqx.field(static=True, default=4096)
    name: str = eqx.field(static=True, default="boundary")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """Errors on every patch, or at random points of all patches."""
        count = sum(patch.target.temperature.size for patch in self.patches)
        if key is None:
            scale = (self.weight / count) ** 0.5
            return tuple(
                scale * row
                for patch in self.patches
                for row in _errors(_patch_values(fields, patch), patch.target, patch.weight)
            )
        chosen = jax.random.randint(key, (min(self.points, count),), 0, count)
        points, target, weight = self._flattened()
        found = fields.at(points[chosen])
        second = self._second_points()
        if second is not None:
            other = fields.at(second[0][chosen])
            # `second` is the point itself where a value, not a difference, is known.
            found = jax.tree.map(
                lambda a, b: a - second[1][chosen].reshape(-1, *[1] * (a.ndim - 1)) * b, found, other
            )
        scale = (self.weight / chosen.shape[0]) ** 0.5
        pick = jax.tree.map(lambda a: a[chosen], (target, weight))
        return tuple(scale * row for row in _errors(found, *pick))

    def with_batch(self, points: int) -> "BoundaryLoss":
        """The same on mini-batches of `points`."""
        return dataclasses.replace(self, points=points)

    def _flattened(self) -> tuple[Float[Array, "points 3"], FlowValues, FlowValues]:
        points = jnp.concatenate([jnp.asarray(points_of(p.spans), jnp.float32) for p in self.patches])
        target = _join([p.target for p in self.patches])
        return points, target, _join([p.weight for p in self.patches])

    def _second_points(self) -> tuple[Float[Array, "points 3"], Float[Array, " points"]] | None:
        if all(p.minus is None for p in self.patches):
            return None
        points = [points_of(p.spans if p.minus is None else p.minus) for p in self.patches]
        flags = [np.full(p.target.temperature.size, p.minus is not None) for p in self.patches]
        return jnp.asarray(np.concatenate(points), jnp.float32), jnp.asarray(
            np.concatenate(flags), jnp.float32
        )


class PointLoss(eqx.Module):
    """Known values at scattered points, each over its standard deviation: sensors, the gauge of p."""

    points_nd: Float[Array, "points 3"]
    target: FlowValues
    weight: FlowValues
    name: str = eqx.field(static=True, default="sensors")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """All points, always: they are few."""
        return _errors(fields.at(self.points_nd), self.target, self.weight)


class MeanLoss(eqx.Module):
    """The mean temperature over scattered points, over its standard deviation: an outlet's thermometer."""

    points_nd: tuple[Float[Array, "points 3"], ...]
    target: Float[Array, " means"]
    weight: Float[Array, " means"]
    name: str = eqx.field(static=True, default="level")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """One row a mean, always: they are few."""
        found = jnp.stack([fields.at(points).temperature.mean() for points in self.points_nd])
        return (self.weight * (found - self.target),)


class SmoothnessLoss(eqx.Module):
    """Mean square slope of T's departure from `expected`, over the slopes that a room has.

    Images see integrals along y only: slopes across the view may be large, slopes along it are taken to be small.
    `slopes` are nondimensional, along x, y, z.
    """

    spans: Spans = eqx.field(static=True)
    expected: Float[Array, "nx ny nz"]
    slopes: tuple[float, float, float] = eqx.field(static=True)
    weight: float = eqx.field(static=True)
    name: str = eqx.field(static=True, default="smoothness")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """Differences between neighbouring vertices."""
        departure = fields.on_grid(self.spans).temperature - self.expected
        rows = []
        for axis, (span, slope) in enumerate(zip(self.spans, self.slopes, strict=True)):
            step = (span[1] - span[0]) / (span[2] - 1)
            difference = jnp.diff(departure, axis=axis)
            rows.append((self.weight / difference.size) ** 0.5 / (step * slope) * difference)
        return tuple(rows)


class PriorLoss(eqx.Module):
    """The prior of the camera's motion: zero, within one standard deviation a view."""

    drift_std: tuple[float, ...] = eqx.field(static=True, default=())
    name: str = eqx.field(static=True, default="prior")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """One row, weighted against losses that are means."""
        if unknowns.drift is None:
            return ()
        return (1e-2 * unknowns.drift / jnp.asarray(self.drift_std)[:, None],)


def all_rows(losses: Sequence[Loss], unknowns: Unknowns) -> PyTree:
    """Every row of every loss, for a Gauss-Newton method."""
    fields = unknowns.representation.fields()
    return tuple(loss.rows(fields, unknowns, None) for loss in losses)


def total(
    losses: Sequence[Loss], unknowns: Unknowns, key: PRNGKeyArray | None
) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
    """The objective and its terms, on mini-batches that are a function of the key."""
    fields = unknowns.representation.fields()
    parts = {}
    for place, loss in enumerate(losses):
        own = None if key is None else jax.random.fold_in(key, place)
        parts[loss.name] = sum(
            (jnp.sum(row**2) for row in loss.rows(fields, unknowns, own)), start=jnp.float32(0)
        )
    return jnp.stack(list(parts.values())).sum(), parts


def _patch_values(fields: Fields, patch: KnownValues) -> FlowValues:
    found = fields.on_grid(patch.spans)
    if patch.minus is None:
        return found
    return jax.tree.map(jnp.subtract, found, fields.on_grid(patch.minus))


def _errors(found: FlowValues, target: FlowValues, weight: FlowValues) -> Rows:
    return tuple(jax.tree.leaves(jax.tree.map(lambda f, t, w: w * (f - t), found, target, weight)))


def _join(flows: Sequence[FlowValues]) -> FlowValues:
    return FlowValues(
        jnp.concatenate([f.temperature.reshape(-1) for f in flows]),
        jnp.concatenate([f.pressure.reshape(-1) for f in flows]),
        jnp.concatenate([f.velocity.reshape(-1, 3) for f in flows]),
    )
