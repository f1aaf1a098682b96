"""Rays and fields that several tests trace."""

import jax
import jax.numpy as jnp
import numpy as np

from core.air import Air
from core.geometry import Box
from core.rays import Rays
from core.rays.bundle import clip_ray, corners_of

ROOM = Box(lower_m=(-1.2, -1.5, 0.0), upper_m=(2.9, 1.5, 3.0))
AIR = Air()
N0 = AIR.ambient_refractivity


def rays_from(origin_m, points_m, room: Box = ROOM) -> Rays:
    """Float64 rays from a lens to points of the back wall; call under `jax.enable_x64`."""
    origin = jnp.asarray(np.asarray(origin_m, float))
    towards = jnp.asarray(np.asarray(points_m, float)) - origin[None]
    direction = towards / jnp.linalg.norm(towards, axis=1, keepdims=True)
    entry, length, outcome = jax.vmap(lambda d: clip_ray(corners_of(room), origin, d))(direction)
    return Rays(entry, direction, length, outcome)


def wall_points(count: int, seed: int = 0) -> np.ndarray:
    """Points of the back wall behind the middle of the room."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(0.0, 1.7, count), np.full(count, 1.5), rng.uniform(0.6, 2.4, count)], axis=1)


def single(tree):
    """The same with float32 arrays."""
    return jax.tree.map(
        lambda a: jnp.asarray(np.asarray(a), jnp.float32 if np.asarray(a).dtype == np.float64 else None), tree
    )
