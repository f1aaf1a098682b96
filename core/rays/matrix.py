"""The straight-ray operator as a sparse matrix in float64, for solvers that need it hundreds of times.

Every path meets four vertices on each plane across the view, or with a window's footprint some six: a product costs
a twentieth of the dense ones of `separable`, and there is nothing to compile. Rows are column and row of each window,
in turn.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from core.rays.gathered import GatheredPaths
from core.rays.operator import StraightRayOperator
from core.rays.paths import AbstractWallPaths
from core.rays.separable import SeparablePaths

Values = Float[np.ndarray, "*some"]


def as_matrix(operator: StraightRayOperator) -> sparse.csr_array:
    """displacement_px = A (N - N0), flattened: 2 windows x vertices. The error is that of float32's entries."""
    own = operator.turn.shape(operator.shape)
    paths = [operator.seen] if operator.lit is None else [operator.seen, operator.lit]
    across, up = _shift_m(paths[0], own)
    for lit in paths[1:]:
        across, up = (part - other for part, other in zip((across, up), _shift_m(lit, own), strict=True))
    px_per_m = np.asarray(operator.px_per_m, np.float64)
    rows = [
        sparse.diags_array(px_per_m[:, n, 0]) @ across + sparse.diags_array(px_per_m[:, n, 1]) @ up
        for n in (0, 1)
    ]
    windows = len(px_per_m)
    both = sparse.csr_array(sparse.vstack(rows))[np.arange(2 * windows).reshape(2, windows).T.ravel()]
    # Column k of the view's own frame is a vertex of the room.
    with jax.enable_x64(True):
        numbers = jnp.arange(np.prod(operator.shape), dtype=jnp.float64).reshape(operator.shape)
        vertex = np.asarray(operator.turn.volume(numbers)).astype(int).ravel()
    place = np.empty_like(vertex)
    place[vertex] = np.arange(len(vertex))
    return sparse.csr_array(both[:, place])


def _shift_m(
    paths: AbstractWallPaths, shape: tuple[int, int, int]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Wall shift along x and z of each path [m]."""
    match paths:
        case SeparablePaths():
            return _of_lattice(paths, shape)
        case GatheredPaths():
            return _of_corners(paths, shape)
        case _:
            raise TypeError(f"{type(paths).__name__} has no matrix; expected separable or gathered paths.")


def _of_corners(
    paths: GatheredPaths, shape: tuple[int, int, int]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    _, ny, nz = shape
    corners = np.asarray(paths.vertex)[..., None] + np.array([0, 1, ny * nz, ny * nz + 1])
    weights = np.asarray(paths.weight_m, np.float64)
    return _matrix(weights[:, :, 0], corners, shape), _matrix(weights[:, :, 1], corners, shape)


def _of_lattice(
    paths: SeparablePaths, shape: tuple[int, int, int]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Through the crossings of the lattice, each read by the paths beside it."""
    crossing, weight = np.asarray(paths.crossing), np.asarray(paths.weight, np.float64)
    needed, taps = np.unique(crossing, return_inverse=True)
    reads = sparse.csr_array(
        (weight.ravel(), (np.repeat(np.arange(len(crossing)), crossing.shape[1]), taps.ravel())),
        shape=(len(crossing), len(needed)),
    )
    across, up = _of_crossings(paths, needed, shape)
    return sparse.csr_array(reads @ across), sparse.csr_array(reads @ up)


def _of_crossings(
    paths: SeparablePaths, crossing: Int[np.ndarray, " crossings"], shape: tuple[int, int, int]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    nx, ny, nz = shape
    column, row = np.divmod(crossing, paths.q.shape[1])
    slope_and_edge = np.asarray(paths.slope_and_edge_x, np.float64).reshape(2, -1, ny, nx)
    along_x = np.stack([*slope_and_edge, np.asarray(paths.value_x, np.float64).reshape(-1, ny, nx)])
    along_z = np.stack([np.asarray(one, np.float64) for one in (paths.value_z, paths.slope_z)])
    # Per line: kind, line, plane, vertex.
    x, x_at = _where(along_x)
    z, z_at = _where(along_z.transpose(0, 3, 1, 2))
    slope_x, edge_x, value_x = (one[column][..., :, None] for one in x)
    value_z, slope_z = (one[row][..., None, :] for one in z)
    p, q = (np.asarray(one, np.float64).ravel()[at] for one, at in ((paths.p, column), (paths.q, row)))
    p, q = (one[:, None, None, None] for one in (p, q))
    stretch = 1 + p**2 + q**2
    gx, edge, gz = slope_x * value_z, edge_x * value_z, value_x * slope_z
    vertex = (x_at[column][..., :, None] * ny + np.arange(ny)[:, None, None]) * nz + z_at[row][..., None, :]
    across = stretch * ((1 + p**2) * gx + p * q * gz - p * edge)
    up = stretch * ((1 + q**2) * gz + p * q * gx - q * edge)
    return _matrix(across, vertex, shape), _matrix(up, vertex, shape)


def _where(
    weights: Float[np.ndarray, "kinds lines planes nodes"],
) -> tuple[Float[np.ndarray, "kinds lines planes few"], Int[np.ndarray, "lines planes few"]]:
    """The weights of each line on each plane that are not zero, as many for all, and the nodes that they are of."""
    used = (weights != 0.0).any(axis=0)
    few = int(used.sum(axis=-1).max())
    nodes = np.sort(np.argsort(~used, axis=-1, kind="stable")[..., :few], axis=-1)
    return np.take_along_axis(weights, nodes[None], axis=-1), nodes


def _matrix(
    weights: Values, vertices: Int[np.ndarray, "*some"], shape: tuple[int, int, int]
) -> sparse.csr_array:
    """Rows of weights on vertices; the first axis of both is that of the rows."""
    rows = len(weights)
    each = weights.reshape(rows, -1)
    matrix = sparse.csr_array(
        (each.ravel(), vertices.reshape(rows, -1).ravel(), np.arange(rows + 1) * each.shape[1]),
        shape=(rows, int(np.prod(shape))),
        copy=True,  # zeros are taken out in place
    )
    matrix.eliminate_zeros()
    return matrix
