"""Pressure in a room with objects: exact, by the box's own cosine solver and a capacitance matrix.

The box is solved as if the objects were air, with unknown forces f on their faces. P is the projection of the box,
B puts a force on a face, and u is the velocity before:

    B^T P (u + B f) = 0     so that     (B^T P B) f = -B^T P u

The matrix has a row for each face of an object. It depends on the grid and on the objects alone, and its inverse is
made once, in float64, from the box's Green function (Buzbee, Dorr, George and Golub 1971). A step costs one solution
of the box, one product with that inverse, and two transforms of few numbers: the pressure beside the objects is read
off the spectrum before that is transformed back, and what the forces add is added to the spectrum. Inside the objects
the velocity is then set to zero.
"""

from functools import lru_cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int
from scipy import sparse

from core.room.pressure import PressureSolver, along_axes, divergence_per_s, pressure_solver
from core.room.room_grid import AXES, Cells, RoomGrid, Velocity, difference
from core.room.solids import Solids, pieces


class ObstructedSolver(eqx.Module):
    """The box's solver; the cells below and above each face of an object, their distance, and minus the inverse.

    `near` are the box's bases at the coordinates of these cells; `below` and `above` count in the block that these
    coordinates span. `open_faces` is 1 where air may pass.
    """

    box: PressureSolver
    near: tuple[Float[Array, "nx bx"], Float[Array, "ny by"], Float[Array, "nz bz"]]
    below: Int[Array, " faces"]
    above: Int[Array, " faces"]
    spacing_m: Float[Array, " faces"]
    force: Float[Array, "faces faces"]
    open_faces: Velocity


def obstructed_solver(grid: RoomGrid, solids: Solids) -> ObstructedSolver:
    """The solver of this grid and these objects; the matrix is kept for the last few."""
    beside, behind = np.asarray(solids.beside), np.asarray(solids.behind)
    below, above = np.minimum(beside, behind), np.maximum(beside, behind)
    force = _force(grid, below.tobytes(), above.tobytes(), solids.count, np.asarray(solids.air).tobytes())
    box = pressure_solver(grid)
    cells = np.stack(np.unravel_index(np.concatenate([below, above]), grid.cells))
    kept, places = zip(*(np.unique(along, return_inverse=True) for along in cells), strict=True)
    block = np.asarray(np.ravel_multi_index(places, tuple(len(k) for k in kept)))
    x, y, z = (basis[:, k] for basis, k in zip(box.bases, kept, strict=True))
    return ObstructedSolver(
        box,
        (x, y, z),
        jnp.asarray(block[: len(below)], jnp.int32),
        jnp.asarray(block[len(below) :], jnp.int32),
        2.0 * solids.centre_m,
        jnp.asarray(force),
        solids.open_faces,
    )


def project_obstructed(
    velocity: Velocity, dt_s: Float[Array, ""], grid: RoomGrid, solver: ObstructedSolver
) -> tuple[Velocity, Cells]:
    """Velocity without divergence and without flow through objects, and the pressure [m2/s2] that made it so."""
    u, v, w = (velocity[a] * solver.open_faces[a] for a in AXES)
    velocity = u, v, w
    spectrum = solver.box.spectrum(divergence_per_s(velocity, grid) / dt_s)
    x, y, z = solver.near
    beside = along_axes(spectrum * solver.box.inverse, x.T, y.T, z.T)
    flat = beside.reshape(-1)
    through = -(flat[solver.above] - flat[solver.below]) / solver.spacing_m
    force = (solver.force @ through) / solver.spacing_m
    added = jnp.zeros_like(flat).at[solver.below].add(force).at[solver.above].add(-force)
    pressure = solver.box.pressure(spectrum + along_axes(added.reshape(beside.shape), x, y, z))
    u, v, w = (
        velocity[a] - _padded(difference(pressure, a) * (dt_s / grid.spacing_m[a]), a) * solver.open_faces[a]
        for a in AXES
    )
    return (u, v, w), pressure


def _padded(inner: Float[Array, "..."], axis: int) -> Float[Array, "..."]:
    return jnp.pad(inner, [(1, 1) if a == axis else (0, 0) for a in AXES])


@lru_cache(maxsize=4)
def _force(
    grid: RoomGrid, below_bytes: bytes, above_bytes: bytes, count: tuple[int, int, int], air_bytes: bytes
) -> Float32[np.ndarray, "faces faces"]:
    """Minus the inverse of the capacitance matrix."""
    below, above = (np.frombuffer(b, np.int32).astype(np.int64) for b in (below_bytes, above_bytes))
    solid = np.frombuffer(air_bytes, np.float32).reshape(grid.cells) == 0
    spacing_m = np.repeat(np.array(grid.spacing_m), count)
    cells, place = np.unique(np.concatenate([below, above]), return_inverse=True)
    rows = np.arange(len(below))
    slope = sparse.csr_matrix(
        (
            np.concatenate([-1.0 / spacing_m, 1.0 / spacing_m]),
            (np.concatenate([rows, rows]), place),
        ),
        shape=(len(rows), len(cells)),
    )
    green = _green(grid, np.stack(np.unravel_index(cells, grid.cells)))
    matrix = np.eye(len(rows)) + slope @ (slope @ green).T
    # A force that is the gradient of a potential of whole objects does nothing: these are the matrix's null space.
    label, found = pieces(solid)
    potentials = np.stack([label.ravel() == n + 1 for n in range(found)], axis=1).astype(float)
    idle = np.linalg.qr((potentials[above] - potentials[below]) / spacing_m[:, None])[0]
    return -np.linalg.inv(matrix + idle @ idle.T).astype(np.float32)


def _green(grid: RoomGrid, cells: Int[np.ndarray, "3 cells"]) -> Float[np.ndarray, "cells cells"]:
    """The inverse Laplacian of the box between these cells: eight images of one table, float64.

    A product of two cosines is the mean of the cosines of sum and difference, so the table needs only both.
    """
    parts, eigenvalues = zip(
        *(_axis(n, h) for n, h in zip(grid.cells, grid.spacing_m, strict=True)), strict=True
    )
    ex, ey, ez = eigenvalues
    total = ex[:, None, None] + ey[None, :, None] + ez[None, None, :]
    total[0, 0, 0] = np.inf
    table = np.einsum("abc,xa,yb,zc->xyz", 1.0 / total, *parts, optimize=True)
    apart = [np.abs(c[:, None] - c[None, :]) for c in cells]
    mirrored = [c[:, None] + c[None, :] + 1 for c in cells]
    green = np.zeros(apart[0].shape)
    for x in (apart[0], mirrored[0]):
        for y in (apart[1], mirrored[1]):
            for z in (apart[2], mirrored[2]):
                green += table[x, y, z]
    return green


def _axis(n: int, spacing_m: float) -> tuple[Float[np.ndarray, "twice n"], Float[np.ndarray, " n"]]:
    """Half the squared norm of each cosine times its value at distances up to 2 n, and the eigenvalues."""
    k = np.arange(n)
    share = np.where(k == 0, 0.5, 1.0) / n
    return share * np.cos(np.pi * np.arange(2 * n)[:, None] * k / n), (
        2 * np.cos(np.pi * k / n) - 2
    ) / spacing_m**2
