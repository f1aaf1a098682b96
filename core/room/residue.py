"""What parameters leave unexplained: a smooth temperature correction, the same along the view.

    T <- T + sum c_ij b_i(x) b_j(z),   c ~ normal(0, K),   linear least squares on the last misfit

A view's rays run along y, so a single view sees only the mean along them. K lets profiles of height err
further than patches of the section, and the level of all furthest: images do not see it, thermometers
do (a plane, an outlet's, sensors). Held walls keep their temperature. Velocity is left alone: nudging it to
fit images does not repair it.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from core.room.fit import CORRELATED, spread
from core.room.grid import AXES, WALLS
from core.room.observe import Observations, ShiftBlocks
from core.room.vertices import linear_matrix

_LATTICE = (9, 11)
_LENGTH_SHARE = 0.2
# Of the misfit that is left, this share is taken for what no smooth correction can explain.
_UNEXPLAINED = 0.5


class Correction(eqx.Module):
    """The correction on vertices, and its variance before and after the data, all the same along y."""

    excess_k: Float[np.ndarray, "vx vz"]
    prior_variance_k2: Float[np.ndarray, "vx vz"]
    variance_k2: Float[np.ndarray, "vx vz"]


def temperature_correction(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    residual: Float[np.ndarray, " data"],
    std_k: float,
    level_std_k: float,
) -> Correction:
    """Fit the correction to `residual` (data minus prediction of `excess_k`).

    `std_k` is the prior size of its departures from a level, `level_std_k` that of the level.
    """
    nx, _, nz = excess_k.shape
    along_x, along_z = (
        linear_matrix(np.linspace(0, 1, m), np.linspace(0, 1, n))
        for m, n in zip(_LATTICE, (nx, nz), strict=True)
    )
    basis = np.einsum("xi,zj->ijxz", along_x, along_z).reshape(-1, nx, nz)
    prior = _prior_k2(std_k) + level_std_k**2
    _, variance, group = data.values()
    rows, weight, left = [], [], []
    designs = (
        (0, _shift_design(data, excess_k, basis)),
        (1, _plane_design(data, excess_k, basis)),
        (2, _sensor_design(data)),
        (4, _outlet_design(data)),
    )
    for g, design in designs:
        own = group == g
        if own.any():
            # A thermometer stands in one place, which no smooth correction describes.
            pooled = g <= 1
            error = _UNEXPLAINED * spread(residual[own]) if pooled else std_k
            rows.append(design)
            left.append(residual[own])
            weight.append(1.0 / (variance[own] + error**2) / (CORRELATED if pooled else 1.0))
    if not rows:
        flat = np.einsum("ixz,ij,jxz->xz", basis, prior, basis)
        return Correction(np.zeros((nx, nz)), flat, flat)
    design, left_over, w = np.concatenate(rows), np.concatenate(left), np.concatenate(weight)
    covariance = np.linalg.inv(np.linalg.inv(prior) + (design.T * w) @ design)
    coefficients = covariance @ ((design.T * w) @ left_over)
    before, after = (
        np.einsum("ixz,ixz->xz", basis, np.tensordot(c, basis, axes=1)) for c in (prior, covariance)
    )
    return Correction(np.tensordot(coefficients, basis, axes=1), before, after)


def _prior_k2(std_k: float) -> Float[np.ndarray, "lattice lattice"]:
    """Covariance: half of it a function of height alone, half local; correlated over a fifth of the room."""
    x, z = (np.linspace(0, 1, m) for m in _LATTICE)
    near_x = np.exp(-np.abs(x[:, None] - x[None, :]) / _LENGTH_SHARE)
    near_z = np.exp(-np.abs(z[:, None] - z[None, :]) / _LENGTH_SHARE)
    size = len(x) * len(z)
    kernel = 0.7 * np.ones_like(near_x)[:, None, :, None] + 0.3 * near_x[:, None, :, None]
    covariance = (kernel * near_z[None, :, None, :]).reshape(size, size)
    return std_k**2 * (covariance + 1e-6 * np.eye(size))


def _sensor_design(data: Observations) -> Float[np.ndarray, "data lattice"]:
    """Sensors' temperatures per kelvin of every coefficient."""
    points = [s.position_m[np.isfinite(s.temperature_k)] for s in data.sensors]
    return _at_points(data, np.concatenate([np.zeros((0, 3)), *points]))


def _outlet_design(data: Observations) -> Float[np.ndarray, "data lattice"]:
    """The outlet's mean temperature per kelvin of every coefficient."""
    rows = [np.zeros((0, _LATTICE[0] * _LATTICE[1]))]
    for outlet in data.outlets:
        patch, wall = outlet.patch, WALLS.index(outlet.patch.wall)
        box = data.scene.room
        first, second = (a for a in AXES if a != wall // 2)
        steps = (np.arange(5) + 0.5) / 5
        points = np.zeros((5, 5, 3))
        points[..., wall // 2] = (box.lower_m, box.upper_m)[wall % 2][wall // 2]
        points[..., first] = (patch.lower_m[0] + steps * (patch.upper_m[0] - patch.lower_m[0]))[:, None]
        points[..., second] = (patch.lower_m[1] + steps * (patch.upper_m[1] - patch.lower_m[1]))[None, :]
        rows.append(_at_points(data, points.reshape(-1, 3)).mean(axis=0, keepdims=True))
    return np.concatenate(rows)


def _at_points(
    data: Observations, points_m: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points lattice"]:
    """Every basis function at points."""
    box = data.scene.room
    share = (points_m - np.asarray(box.lower_m)) / np.asarray(box.size_m)
    x, z = (
        linear_matrix(np.linspace(0, 1, m), np.clip(share[:, a], 0.0, 1.0))
        for a, m in zip((0, 2), _LATTICE, strict=True)
    )
    return np.einsum("pi,pj->pij", x, z).reshape(len(points_m), _LATTICE[0] * _LATTICE[1])


def _shift_design(
    data: Observations, excess_k: Float[np.ndarray, "vx vy vz"], basis: Float[np.ndarray, "lattice vx vz"]
) -> Float[np.ndarray, "blocks lattice"]:
    """Shifts of every block per kelvin of every coefficient."""
    air = data.scene.air
    slope = (
        -air.ambient_refractivity * air.ambient_temperature_k / (air.ambient_temperature_k + excess_k) ** 2
    )
    fields = jnp.asarray(basis[:, :, None, :] * slope[None], jnp.float32)
    columns = [
        np.stack([block.pooled(d).ravel() for d in _shifts(block, fields)], axis=1) for block in data.shifts
    ]
    return np.concatenate(columns) if columns else np.zeros((0, len(basis)))


def _shifts(
    block: ShiftBlocks, fields: Float[jax.Array, "lattice vx vy vz"]
) -> Float[np.ndarray, "lattice windows 2"]:
    run = eqx.filter_jit(lambda operator, many: jax.lax.map(operator.apply, many))
    return np.asarray(run(block.operator, fields))


def _plane_design(
    data: Observations, excess_k: Float[np.ndarray, "vx vy vz"], basis: Float[np.ndarray, "lattice vx vz"]
) -> Float[np.ndarray, "blocks lattice"]:
    """Plane temperatures of every block per kelvin of every coefficient."""
    if not data.planes:
        return np.zeros((0, len(basis)))
    fields = np.broadcast_to(basis[:, :, None, :], (len(basis), *excess_k.shape))
    return np.stack([data.plane_values(field) for field in fields], axis=1)
