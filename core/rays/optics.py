"""Pixels to directions and points to pixels, for a pinhole with Brown-Conrady distortion.

Everything here is meant to run once per scene in float64 (under `jax.enable_x64`): at 4096 px a float32
coordinate has a step of 2.4e-4 px, and the shifts to be measured are 5e-3 px.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.geometry import Optics

_NEWTON_STEPS = 8


class Pinhole(eqx.Module):
    """The numbers of `Optics` as arrays, so that one compiled program serves every lens."""

    focal_px: Float[Array, "2"]
    principal_px: Float[Array, "2"]
    position_m: Float[Array, "3"]
    rotation: Float[Array, "3 3"]
    distortion: Float[Array, "5"]
    distorted: bool = eqx.field(static=True)

    def direction(self, pixel: Float[Array, "2"]) -> Float[Array, "3"]:
        """Unit direction in the world of the ray through a pixel (column, row)."""
        plane = self._undistort((pixel - self.principal_px) / self.focal_px)
        ray = self.rotation.T @ jnp.concatenate([plane, jnp.ones_like(plane[:1])])
        return ray / jnp.linalg.norm(ray)

    def project(self, point_m: Float[Array, "3"]) -> Float[Array, "2"]:
        """Pixel (column, row) that sees a world point in front of the optics."""
        x, y, z = self.rotation @ (point_m - self.position_m)
        plane = jnp.stack([x / z, y / z])
        return self.principal_px + self.focal_px * (self._distort(plane) if self.distorted else plane)

    def depth_m(self, point_m: Float[Array, "3"]) -> Float[Array, ""]:
        """Distance along the optical axis; negative behind the optics."""
        return self.rotation[2] @ (point_m - self.position_m)

    def _distort(self, plane: Float[Array, "2"]) -> Float[Array, "2"]:
        """Brown-Conrady, OpenCV's order (k1, k2, p1, p2, k3)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = plane
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        tangential = jnp.stack(
            [2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y]
        )
        return plane * radial + tangential

    def _undistort(self, distorted: Float[Array, "2"]) -> Float[Array, "2"]:
        """Newton's method on `_distort`: quadratic, so a fixed number of steps reaches rounding."""
        if not self.distorted:
            return distorted

        def step(_: Array, plane: Float[Array, "2"]) -> Float[Array, "2"]:
            (a, b), (c, d) = jax.jacfwd(self._distort)(plane)
            ex, ey = self._distort(plane) - distorted
            return plane - jnp.stack([d * ex - b * ey, a * ey - c * ex]) / (a * d - b * c)

        return jax.lax.fori_loop(0, _NEWTON_STEPS, step, distorted)


def pinhole(optics: Optics) -> Pinhole:
    """Arrays of `optics` in JAX's widest enabled float (float64 under `jax.enable_x64`)."""
    return Pinhole(
        focal_px=jnp.asarray(np.array(optics.focal_px)),
        principal_px=jnp.asarray(np.array(optics.principal_px)),
        position_m=jnp.asarray(np.array(optics.position_m)),
        rotation=jnp.asarray(optics.rotation),
        distortion=jnp.asarray(np.array(optics.distortion)),
        distorted=any(optics.distortion),
    )
