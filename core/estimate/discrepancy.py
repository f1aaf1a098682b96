"""Model discrepancy in T: a smooth correction of the temperature for what no parameter explains.

    T <- T + sum c_ij b_i(x) b_j(z),   c ~ normal(0, K),   linear least squares on the last residual

The correction is constant along y, the direction of view, since one view sees only the mean along its rays.
K has three parts: errors of the profile over height, local errors in the x-z section, and an error of the
level (the mean). Images do not see the level; thermometers do (a plane, outlets, sensors). A plane on a wall
of unknown temperature lies in that wall's thermal layer, which the model may have wrong by one constant: that
constant is estimated too. Walls of stated temperature keep it. The velocity is not corrected.
"""

from collections.abc import Collection

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from core.estimate.least_squares import spread
from core.estimate.observation import IMAGES, PLANES, Observations, ShiftBlocks
from core.geometry import face_of
from core.room.vertices import linear_matrix

# So many neighbouring data count as one. Fewer than in the fit of the parameters (`core.data_error`): what
# neighbours have wrong in common is what the correction is to take up.
_CORRELATED = 4.0
# Basis functions along x and z.
_LATTICE = (9, 11)
# Correlation length of K, as a share of the room.
_LENGTH_SHARE = 0.2
# Of K's variance: errors of the profile over height, and local errors.
_PROFILE_PART, _LOCAL_PART = 0.7, 0.3
# Of the residual, this share is taken as representation error: no smooth correction can explain it.
_UNEXPLAINED = 0.5
# Standard deviations as shares of the rms departure of T from its mean at each height: the correction's; that of
# one point from the mean along y; that of the layer of a plane on a wall of unknown temperature.
_DEPARTURE_SHARE, _POINT_SHARE, _LAYER_SHARE = 0.1, 0.3, 1.0


class Correction(eqx.Module):
    """The correction on vertices, and its prior and posterior variance; all constant along y."""

    excess_k: Float[np.ndarray, "vx vz"]
    prior_variance_k2: Float[np.ndarray, "vx vz"]
    variance_k2: Float[np.ndarray, "vx vz"]


def temperature_correction(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    residual: Float[np.ndarray, " data"],
    departure_k: float,
    level_std_k: float,
    unknown_walls: Collection[str] = (),
) -> Correction:
    """Fit the correction to `residual`, the data minus the prediction from `excess_k`.

    `departure_k` is the rms departure of T from its mean at each height; `level_std_k` is the prior standard
    deviation of the level.
    """
    nx, _, nz = excess_k.shape
    along_x, along_z = (
        linear_matrix(np.linspace(0, 1, m), np.linspace(0, 1, n))
        for m, n in zip(_LATTICE, (nx, nz), strict=True)
    )
    basis = np.einsum("xi,zj->ijxz", along_x, along_z).reshape(-1, nx, nz)
    _, variance, group = data.values()
    prior = _prior_k2(_DEPARTURE_SHARE * departure_k) + level_std_k**2
    layers = sum(plane.wall in unknown_walls for plane in data.planes)
    layer = np.eye(layers) / (_LAYER_SHARE * departure_k) ** 2
    known = np.asarray(block_diag(np.linalg.inv(prior), layer))
    gained = np.zeros(len(known))
    for g, design in (
        (IMAGES, _shift_design(data, excess_k, basis)),
        (PLANES, _plane_design(data, excess_k, basis)),
        (2, _sensor_design(data)),
        (4, _outlet_design(data)),
    ):
        own = group == g
        if own.any():
            # A thermometer reads one point, and the correction is a mean along y.
            pooled = g in (IMAGES, PLANES)
            error = _UNEXPLAINED * spread(residual[own]) if pooled else _POINT_SHARE * departure_k
            weight = 1.0 / (variance[own] + error**2) / (_CORRELATED if pooled else 1.0)
            extra = _layer_design(data, unknown_walls) if g == PLANES else np.zeros((len(design), layers))
            whole = np.concatenate([design, extra], axis=1)
            known = known + (whole.T * weight) @ whole
            gained = gained + (whole.T * weight) @ residual[own]
    size = len(basis)
    covariance = np.linalg.inv(known)
    coefficients = (covariance @ gained)[:size]
    before, after = (
        np.einsum("ixz,ixz->xz", basis, np.tensordot(c, basis, axes=1))
        for c in (prior, covariance[:size, :size])
    )
    return Correction(np.tensordot(coefficients, basis, axes=1), before, after)


def _layer_design(data: Observations, unknown_walls: Collection[str]) -> Float[np.ndarray, "data layers"]:
    """Derivative of the planes' blocks in the layer constant of each plane on an unknown wall."""
    blocks = data.plane_blocks()
    columns = np.repeat(np.eye(len(blocks)), blocks, axis=0)
    return columns[:, [plane.wall in unknown_walls for plane in data.planes]]


def _prior_k2(std_k: float) -> Float[np.ndarray, "lattice lattice"]:
    """Covariance K without its level: 0.7 of it depends on height alone, 0.3 is local."""
    x, z = (np.linspace(0, 1, m) for m in _LATTICE)
    near_x = np.exp(-np.abs(x[:, None] - x[None, :]) / _LENGTH_SHARE)
    near_z = np.exp(-np.abs(z[:, None] - z[None, :]) / _LENGTH_SHARE)
    size = len(x) * len(z)
    kernel = _PROFILE_PART * np.ones_like(near_x)[:, None, :, None] + _LOCAL_PART * near_x[:, None, :, None]
    covariance = (kernel * near_z[None, :, None, :]).reshape(size, size)
    return std_k**2 * (covariance + 1e-6 * np.eye(size))


def _sensor_design(data: Observations) -> Float[np.ndarray, "data lattice"]:
    """Derivative of the sensors' temperatures in every coefficient."""
    points = [s.position_m[np.isfinite(s.temperature_k)] for s in data.sensors]
    return _at_points(data, np.concatenate([np.zeros((0, 3)), *points]))


def _outlet_design(data: Observations) -> Float[np.ndarray, "data lattice"]:
    """Derivative of the outlets' temperatures in every coefficient, as the mean over x at the outlet's height.

    Windows beside walls are left out, so the correction at the outlet's own wall is an extrapolation only.
    """
    rows = [np.zeros((0, _LATTICE[0] * _LATTICE[1]))]
    for _, outlet, _ in data.outlets:
        patch, face = outlet.patch, face_of(outlet.patch.wall)
        box, (first, second) = data.scene.room, face.along
        steps = (np.arange(5) + 0.5) / 5
        points = np.zeros((5, 5, 3))
        points[..., face.axis] = face.place_m(box)
        points[..., first] = (patch.lower_m[0] + steps * (patch.upper_m[0] - patch.lower_m[0]))[:, None]
        points[..., second] = (patch.lower_m[1] + steps * (patch.upper_m[1] - patch.lower_m[1]))[None, :]
        row = _at_points(data, points.reshape(-1, 3)).mean(axis=0).reshape(_LATTICE)
        rows.append(np.broadcast_to(row.sum(0) / _LATTICE[0], _LATTICE).reshape(1, -1))
    return np.concatenate(rows)


def _at_points(
    data: Observations, points_m: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points lattice"]:
    """The basis functions at points."""
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
    """Derivative of the blocks' shifts in every coefficient."""
    air = data.scene.air
    slope = (
        -air.ambient_refractivity * air.ambient_temperature_k / (air.ambient_temperature_k + excess_k) ** 2
    )
    fields = jnp.asarray(basis[:, :, None, :] * slope[None], jnp.float32)
    columns = [
        np.stack([block.pooled(d).ravel() for d in _shifts(block, fields)], axis=1) for block in data.shifts
    ]
    if not columns:
        return np.zeros((0, len(basis)))
    design = np.concatenate(columns)
    # One kelvin on the level changes the shifts by 0.7 %, far less than the model error: images do not set the level.
    return design - design.mean(axis=1, keepdims=True)


def _shifts(
    block: ShiftBlocks, fields: Float[jax.Array, "lattice vx vy vz"]
) -> Float[np.ndarray, "lattice windows 2"]:
    run = eqx.filter_jit(lambda operator, many: jax.lax.map(operator.apply, many))
    return np.asarray(run(block.operator, fields))


def _plane_design(
    data: Observations, excess_k: Float[np.ndarray, "vx vy vz"], basis: Float[np.ndarray, "lattice vx vz"]
) -> Float[np.ndarray, "blocks lattice"]:
    """Derivative of the planes' blocks in every coefficient."""
    if not data.planes:
        return np.zeros((0, len(basis)))
    fields = np.broadcast_to(basis[:, :, None, :], (len(basis), *excess_k.shape))
    return np.stack([data.plane_values(field) for field in fields], axis=1)
