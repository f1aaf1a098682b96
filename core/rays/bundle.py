"""Rays, clipped to the room: where each enters, its direction, and its length in the air.

The free space outside the room is skipped exactly: a tracer starts at the entry and ends at the back
wall, so a stand-off of 300 m costs no digits. Made in float64, stored in float32, relative to nothing:
room coordinates of some metres have a float32 step of 2e-7 m, a hundred-thousandth of a grid cell.
"""

from enum import IntEnum

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from core.fields import Components, apart
from core.geometry import Box


class RayOutcome(IntEnum):
    """Where a ray ends."""

    wall = 0  # on the back wall: it sees the pattern
    side = 1  # on another face of the room
    missed = 2  # it never enters the room, or looks away from it
    turned_back = 3  # bent so strongly that it never reaches the wall (a mirage)


class Rays(eqx.Module):
    """Straight rays in the room, one or a batch. A ray that misses has length 0 and a finite entry."""

    entry_m: Float[Array, "*rays 3"]
    direction: Float[Array, "*rays 3"]
    length_m: Float[Array, "*rays"]
    outcome: Int[Array, "*rays"]

    @property
    def on_wall(self) -> Array:
        """Whether the straight ray ends on the back wall."""
        return self.outcome == RayOutcome.wall


def walk(rays: Rays, along_m: Float[Array, " rays"]) -> Components:
    """Coordinates of the point `along_m` down each ray, component by component."""
    (x, y, z), (dx, dy, dz) = apart(rays.entry_m), apart(rays.direction)
    return x + along_m * dx, y + along_m * dy, z + along_m * dz


def corners_of(room: Box) -> Float[Array, "2 3"]:
    """The room's lower and upper corner. As an array they are no part of a compiled program: one serves all rooms."""
    return jnp.asarray([room.lower_m, room.upper_m])


def clip_ray(
    corners_m: Float[Array, "2 3"], origin_m: Float[Array, "3"], direction: Float[Array, "3"]
) -> tuple[Float[Array, "3"], Float[Array, ""], Int[Array, ""]]:
    """Entry [m], length in the room [m] and outcome of one ray (slab method).

    A ray along a face counts as inside; one that starts inside enters where it starts.
    """
    lower, upper = corners_m
    # Along an axis that the ray does not move on, it is inside for ever or never: no 0 / 0 on a face.
    parallel = jnp.abs(direction) < jnp.finfo(direction.dtype).tiny
    within = jnp.where((origin_m >= lower) & (origin_m <= upper), -jnp.inf, jnp.inf)
    safe = jnp.where(parallel, 1.0, direction)
    first, second = (lower - origin_m) / safe, (upper - origin_m) / safe
    enter = jnp.maximum(jnp.max(jnp.where(parallel, within, jnp.minimum(first, second))), 0.0)
    leave_axes = jnp.where(parallel, -within, jnp.maximum(first, second))
    leave = jnp.min(leave_axes)
    misses = leave <= enter
    # The back wall wins a tie on an edge: the pattern reaches to the corners.
    to_wall = (direction[1] > 0) & (leave_axes[1] <= leave)
    outcome = jnp.where(misses, RayOutcome.missed, jnp.where(to_wall, RayOutcome.wall, RayOutcome.side))
    enter, leave = (jnp.where(misses, 0.0, t) for t in (enter, leave))
    # A ray that misses stands still at the nearest point of the room.
    entry = jnp.clip(origin_m + enter * direction, lower, upper)
    return entry, leave - enter, outcome.astype(jnp.int32)
