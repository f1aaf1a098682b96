"""Exact pressure on the staggered grid: the velocity leaves with no divergence at all.

    lap p = div u / dt,   dp/dn = 0 on walls,   u <- u - dt grad p

The 7-point Laplacian with Neumann walls is diagonal in the cosine basis (DCT-II); as one dense matrix
an axis it costs 12 n^4 multiplications for n^3 cells, which a matrix library does faster than a fast
transform below n = 128, and every derivative of it is again a matrix product.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from core.room.room_grid import (
    AXES,
    Cells,
    RoomGrid,
    Velocity,
    cut,
    difference,
    first_plane,
    last_plane,
    with_walls,
)


class PressureSolver(eqx.Module):
    """Orthonormal cosine bases of the three axes and the inverse eigenvalues."""

    bases: tuple[Float[Array, "nx nx"], Float[Array, "ny ny"], Float[Array, "nz nz"]]
    inverse: Float[Array, "nx ny nz"]

    def solve(self, source: Cells) -> Cells:
        """p with lap p = source, zero mean; the mean of `source` is dropped."""
        return self.pressure(self.spectrum(source))

    def spectrum(self, source: Cells) -> Cells:
        """The source in the cosine basis."""
        bx, by, bz = self.bases
        return along_axes(source, bx, by, bz)

    def pressure(self, spectrum: Cells) -> Cells:
        """The pressure of a source of this spectrum."""
        bx, by, bz = self.bases
        return along_axes(spectrum * self.inverse, bx.T, by.T, bz.T)


def pressure_solver(grid: RoomGrid) -> PressureSolver:
    """Bases and eigenvalues of `grid`, made in float64."""
    bases, eigenvalues = zip(
        *(_axis(n, h) for n, h in zip(grid.cells, grid.spacing_m, strict=True)), strict=True
    )
    ex, ey, ez = eigenvalues
    total = ex[:, None, None] + ey[None, :, None] + ez[None, None, :]
    total[0, 0, 0] = 1.0
    inverse = 1.0 / total
    inverse[0, 0, 0] = 0.0
    bx, by, bz = (jnp.asarray(basis, jnp.float32) for basis in bases)
    return PressureSolver((bx, by, bz), jnp.asarray(inverse, jnp.float32))


def divergence_per_s(velocity: Velocity, grid: RoomGrid) -> Cells:
    """div u in every cell."""
    dx, dy, dz = (difference(velocity[a], a) / grid.spacing_m[a] for a in AXES)
    return dx + dy + dz


def project(
    velocity: Velocity, dt_s: Float[Array, ""], grid: RoomGrid, solver: PressureSolver
) -> tuple[Velocity, Cells]:
    """Velocity without divergence, and the pressure [m2/s2] that made it so."""
    pressure = solver.solve(divergence_per_s(velocity, grid) / dt_s)
    u, v, w = (_correct(velocity[a], difference(pressure, a) * (dt_s / grid.spacing_m[a]), a) for a in AXES)
    return (u, v, w), pressure


def _correct(component: Float[Array, "..."], step: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    inner = cut(component, 1, -1, axis) - step
    return with_walls(first_plane(component, axis), inner, last_plane(component, axis), axis)


def along_axes(
    field: Float[Array, "nx ny nz"],
    bx: Float[Array, "mx nx"],
    by: Float[Array, "my ny"],
    bz: Float[Array, "mz nz"],
) -> Float[Array, "mx my mz"]:
    """Each basis takes the last axis and puts it first: three plain matrix products, and none transposes."""
    for basis in (bz, by, bx):
        rows = field.reshape(-1, basis.shape[1])
        product = lax.dot_general(basis, rows, (((1,), (1,)), ((), ())))
        field = product.reshape(basis.shape[0], *field.shape[:-1])
    return field


def _axis(n: int, spacing_m: float) -> tuple[Float[np.ndarray, "n n"], Float[np.ndarray, " n"]]:
    k = np.arange(n)[:, None]
    basis = np.sqrt(2.0 / n) * np.cos(np.pi * k * (np.arange(n)[None, :] + 0.5) / n)
    basis[0] = np.sqrt(1.0 / n)
    return basis, (2.0 * np.cos(np.pi * np.arange(n) / n) - 2.0) / spacing_m**2
