"""Observability: which patterns of temperature the views determine, by the straight-ray operator's spectrum.

On a coarse vertex grid the excess temperature has a smooth Gaussian prior with covariance L L^T. The
singular values s of  W^1/2 A L  are the signal to noise of each mode; a mode with s > 1 is seen. The share
of the prior's variance that a set of measurements removes is  1 - tr(posterior) / tr(prior).
Cost: a few Cholesky factors of 770 unknowns.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular

from core.known_temperature import VertexGrid, known_temperature
from core.plan.expected import ExpectedFlow
from core.plan.signal import Signal
from core.problem import Problem
from core.rays.operator import build
from core.scene import Scene

_SHAPE = (11, 7, 10)
# Correlation length of the prior, in parts of each edge of the room.
_LENGTH = 0.15


@dataclass(frozen=True)
class Seen:
    """Modes of the temperature that stand out of the noise, and shares of variance that are found."""

    modes: int
    modes_seen: int
    images: float
    boundary: float
    both: float
    # What the images of the first view, of the first two, and so on fix.
    first_views: tuple[float, ...]
    # What each view says of the modes, over its noise.
    rows: tuple[Float[np.ndarray, "rows size"], ...] = ()


def seen(problem: Problem, flow: ExpectedFlow, signals: tuple[Signal, ...]) -> Seen:
    """How much of an unknown temperature of the expected size the images and the boundary determine."""
    root = prior_root(problem.scene, flow)
    rows = [rows_of(problem.scene, view, flow, found) @ root for view, found in enumerate(signals)]
    images = np.concatenate(rows)
    share = share_of(images, root)
    first_views = tuple(share_of(np.concatenate(rows[:n]), root) for n in range(1, len(rows)))
    known = _known_rows(problem, VertexGrid(problem.scene.room, _SHAPE)) @ root
    # Squares of the singular values.
    values = np.linalg.eigvalsh(images.T @ images)
    return Seen(
        len(root),
        int(np.sum(values > 1.0)),
        share,
        share_of(known, root),
        share_of(np.concatenate([images, known]), root),
        (*first_views, share),
        tuple(rows),
    )


def rows_of(scene: Scene, view: int, flow: ExpectedFlow, found: Signal) -> Float[np.ndarray, "rows size"]:
    """What one view's windows say of the temperature at the grid's vertices, each over its deviation [1/K]."""
    per_k = scene.air.ambient_refractivity / scene.air.ambient_temperature_k
    operator = build(scene, view, found.shift.centres_px, _SHAPE, float(found.noise.window_px))
    size = int(np.prod(_SHAPE))
    matrix = np.asarray(_columns(operator, size))
    whitened = matrix.transpose(1, 2, 0) / np.array(found.noise.std_px)[None, :, None]
    return whitened.reshape(-1, size) * (-per_k * found.shift.stride)


def _columns(operator, size: int):
    """Displacements by a unit at each vertex."""
    basis = jnp.eye(size, dtype=jnp.float32).reshape(size, *_SHAPE)
    return jax.lax.map(operator.apply, basis)


def prior_root(scene: Scene, flow: ExpectedFlow) -> Float[np.ndarray, "size size"]:
    """L with L L^T the separable Gaussian covariance of the expected departures' variance [K]."""
    factors = []
    for n in VertexGrid(scene.room, _SHAPE).shape:
        apart = np.subtract.outer(np.linspace(0, 1, n), np.linspace(0, 1, n))
        covariance = np.exp(-0.5 * (apart / _LENGTH) ** 2) + 1e-6 * np.eye(n)
        factors.append(np.linalg.cholesky(covariance))
    departure = flow.excess_k - flow.excess_k.mean(axis=(0, 1))
    return np.kron(np.kron(factors[0], factors[1]), factors[2]) * max(float(departure.std()), 1e-9)


def _known_rows(problem: Problem, grid: VertexGrid) -> Float[np.ndarray, "known size"]:
    """Rows of what is known of the temperature, each over its standard deviation."""
    known = known_temperature(problem, grid)
    mask = known.mask.ravel()
    rows = [np.eye(len(mask))[mask] / known.std_k.ravel()[mask][:, None]]
    for members, _, std in known.means:
        row = np.zeros((1, len(mask)))
        row[0, members] = 1.0 / (len(members) * std)
        rows.append(row)
    return np.concatenate(rows)


def share_of(rows: np.ndarray, root: np.ndarray) -> float:
    """Share of the prior's variance that measurements with these whitened rows remove.

    What is left is L (I + R^T R)^-1 L^T. With C C^T = I + R^T R its trace is the sum of squares of C^-1 L^T.
    """
    factor = np.linalg.cholesky(rows.T @ rows + np.eye(rows.shape[1]))
    left = solve_triangular(factor, root.T, lower=True)
    return max(float(1.0 - np.sum(left**2) / np.sum(root**2)), 0.0)
