"""Model discrepancy in T: a smooth correction of the temperature for what no parameter explains.

    T <- T + sum_k c_k b_k(z) + sum_a sum_ij c_aij b_i b_j,   c ~ normal(0, K)

Linear least squares on the last residual. The first sum is an error of the profile over height, which holds that of
the level (the mean). The second has one part for each axis a that a view looks along, and is constant along it, since
a view sees only means along its rays: a view of y_max tells b_i(x) b_j(z), one of x_max b_i(y) b_j(z). K is the
covariance of the coefficients: what is near one another is wrong alike, and parts are independent.

Images do not see the level; thermometers do (a plane of air, outlets, sensors). The errors that the windows of a
picture share, such as what the camera may have done, are marginalised. The velocity is not corrected.

How large the correction may be follows from the residual itself, by its marginal likelihood: a room that the data
contradict is corrected further, and is less certain, than one that they confirm. The error of images and planes
beyond their noise is found with it.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag
from scipy.optimize import minimize

from core.data_error import LENGTH_SHARE, alike_share
from core.estimate.least_squares import spread
from core.estimate.observation import IMAGES, OUTLETS, PLANES, SENSORS, Observations, ShiftBlocks
from core.geometry import face_of
from core.room.vertices import linear_matrix
from core.scene import Scene
from core.view_frame import looked_along

# So many neighbouring data count as one. Fewer than in the fit of the parameters (`Observations.alike`): what
# neighbours have wrong in common is what the correction is to take up.
_CORRELATED = 4.0
# Basis functions along x, y and z.
_LATTICE = (9, 9, 11)
# Of the variance of what one view sees: errors of the profile over height, and local errors.
_PROFILE_PART, _LOCAL_PART = 0.7, 0.3
# An error of T is as short along a view as across it: of its variance the mean along the view keeps this share.
_SEEN_SHARE = alike_share(1)

# Numbers of basis functions along x, y and z of a part of the correction: one along an axis is a constant.
_Part = tuple[int, int, int]


class Correction(eqx.Module):
    """The correction on vertices, and its prior and posterior variance; one vertex along an axis without change.

    `point_k2` is the variance of one point about what views see. `level_std_k` is the posterior deviation of the
    mean over the room. `bases` and `covariance_k2` are those of the posterior's coefficients.
    """

    excess_k: Float[np.ndarray, "vx vy vz"]
    prior_variance_k2: Float[np.ndarray, "vx vy vz"]
    variance_k2: Float[np.ndarray, "vx vy vz"]
    point_k2: float
    level_std_k: float
    bases: list[Float[np.ndarray, "functions _ _ _"]]
    covariance_k2: Float[np.ndarray, "coefficients coefficients"]

    def goes_with(self, weights: Float[np.ndarray, "vx vy vz"]) -> Float[np.ndarray, "vx vy vz"]:
        """Covariance of the error at each vertex with that of a weighted sum over vertices."""
        taken = np.concatenate([_sums(basis, weights) for basis in self.bases])
        return np.broadcast_to(_field(self.bases, self.covariance_k2 @ taken), weights.shape)


class _Residuals(eqx.Module):
    """Residuals of one kind, derivatives in the coefficients, and errors that they share.

    `start` is the kind's error beyond noise from which the search begins; None: thermometers, which read one point
    where the correction is a mean along a view.
    """

    residual: Float[np.ndarray, " data"]
    noise: Float[np.ndarray, " data"]
    design: Float[np.ndarray, "data unknowns"]
    shared: Float[np.ndarray, "data errors"]
    start: float | None


class _Fitted(eqx.Module):
    """Coefficients, their covariance, and the logarithm of the residuals' probability."""

    mean: Float[np.ndarray, " unknowns"]
    covariance: Float[np.ndarray, "unknowns unknowns"]
    log_evidence: float


def temperature_correction(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    residual: Float[np.ndarray, " data"],
    departure_k: float,
    level_std_k: float,
    wrong_share: float,
    outlet_std_k: float = 0.0,
) -> Correction:
    """Fit the correction to `residual`, the data minus the prediction from `excess_k`.

    `departure_k` is the rms departure of T from its mean at each height, of which a point is expected to be wrong by
    `wrong_share`, known to a factor e; `level_std_k` is the prior standard deviation of the level; `outlet_std_k` is
    how far what leaves may be, in the model, from the air at the outlet's height.
    """
    parts = _parts(data.scene)
    bases = [_basis(part, excess_k.shape) for part in parts]
    kinds = _kinds(data, excess_k, residual, parts, bases, outlet_std_k)

    def prior_k2(std_k: float) -> np.ndarray:
        profile, *local = (std_k**2 * _prior_share(part) for part in parts)
        return np.asarray(block_diag(profile + level_std_k**2, *local))

    std_k, errors = _sizes(
        kinds, prior_k2, _unseen_share(parts), wrong_share * departure_k * float(np.sqrt(_SEEN_SHARE))
    )
    prior, point_k2 = prior_k2(std_k), _unseen_share(parts) * std_k**2
    fitted = _fit(kinds, prior, errors, point_k2)
    before, after = (_variance(bases, c) for c in (prior, fitted.covariance))
    level = np.concatenate([basis.mean((1, 2, 3)) for basis in bases])
    level_std_k = float(np.sqrt(level @ fitted.covariance @ level))
    change = _field(bases, fitted.mean)
    return Correction(change, before, after, point_k2, level_std_k, bases, fitted.covariance)


def _parts(scene: Scene) -> list[_Part]:
    """The profile over height, and what is local, for each axis that a view looks along."""
    profile: _Part = (1, 1, _LATTICE[2])
    return [profile, *(_across(axis) for axis in looked_along(scene))]


def _across(axis: int) -> _Part:
    nx, ny, nz = (1 if a == axis else n for a, n in enumerate(_LATTICE))
    return nx, ny, nz


def _unseen_share(parts: list[_Part]) -> float:
    """Variance of a point about what the parts hold of it, over that of what one view sees."""
    return 1.0 / _SEEN_SHARE - _PROFILE_PART - _LOCAL_PART * (len(parts) - 1)


def _basis(part: _Part, shape: tuple[int, int, int]) -> Float[np.ndarray, "functions vx vy vz"]:
    """A part's basis functions on vertices; one vertex along an axis where it is constant."""
    x, y, z = (
        _hats(n, np.linspace(0, 1, vertices if n > 1 else 1)) for n, vertices in zip(part, shape, strict=True)
    )
    return np.einsum("xi,yj,zk->ijkxyz", x, y, z).reshape(-1, len(x), len(y), len(z))


def _hats(count: int, share: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points functions"]:
    """Piecewise linear functions along an axis, at places from 0 to 1; one of them is a constant."""
    return np.ones((len(share), 1)) if count == 1 else linear_matrix(np.linspace(0, 1, count), share)


def _field(
    bases: list[Float[np.ndarray, "functions _ _ _"]], coefficients: Float[np.ndarray, " unknowns"]
) -> Float[np.ndarray, "vx vy vz"]:
    """The correction with these coefficients."""
    ends = np.cumsum([len(basis) for basis in bases])
    parts = np.split(coefficients, ends[:-1])
    return np.asarray(sum(np.tensordot(c, basis, axes=1) for c, basis in zip(parts, bases, strict=True)))


def _variance(
    bases: list[Float[np.ndarray, "functions _ _ _"]], covariance: Float[np.ndarray, "unknowns unknowns"]
) -> Float[np.ndarray, "vx vy vz"]:
    """Variance of the correction at vertices, from the covariance of its coefficients."""
    values, vectors = np.linalg.eigh(covariance)
    roots = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return np.asarray(sum(np.square(_field(bases, root)) for root in roots))


def _sums(
    basis: Float[np.ndarray, "functions _ _ _"], weights: Float[np.ndarray, "vx vy vz"]
) -> Float[np.ndarray, " functions"]:
    """Weighted sum over vertices of each function; one vertex along an axis stands for all."""
    constant = tuple(a for a in range(3) if basis.shape[1 + a] == 1)
    return np.tensordot(basis, weights.sum(axis=constant, keepdims=True), axes=3)


def _kinds(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    residual: Float[np.ndarray, " data"],
    parts: list[_Part],
    bases: list[Float[np.ndarray, "functions _ _ _"]],
    outlet_std_k: float,
) -> list[_Residuals]:
    """What there is of images, planes, sensors and outlets."""
    _, variance, group = data.values()
    shared = _shared_errors(data)
    own_errors = data.unshared(residual, variance)
    found = []
    for g, designs in (
        (IMAGES, [_shift_design(data, excess_k, basis) for basis in bases]),
        (PLANES, [_plane_design(data, excess_k, basis) for basis in bases]),
        (SENSORS, [_sensor_design(data, part) for part in parts]),
        (OUTLETS, [_outlet_design(data, part) for part in parts]),
    ):
        own, design = group == g, np.concatenate(designs, axis=1)
        if own.any():
            common = shared if g == IMAGES else np.zeros((len(design), 0))
            # A hundredth of the noise at least: the search begins above zero where a room fits exactly.
            least = 0.01 * float(np.sqrt(np.median(variance[own])))
            start = max(0.5 * spread(own_errors[own]), least) if g in (IMAGES, PLANES) else None
            noise = variance[own] + (outlet_std_k**2 if g == OUTLETS else 0.0)
            found.append(_Residuals(residual[own], noise, design, common, start))
    return found


def _sizes(
    kinds: list[_Residuals], prior_k2: Callable[[float], np.ndarray], unseen: float, expected_k: float
) -> tuple[float, list[float]]:
    """The standard deviation of what one view sees of the correction, and each pooled kind's error.

    `unseen` is the variance of a point about the correction, over that deviation's square.

    The errors are those under which the residuals are most likely. The correction's variance is the mean over all
    that the residuals leave possible: where they say little it stays wide.
    """
    starts = np.array([kind.start for kind in kinds if kind.start is not None])

    def loss(logs: np.ndarray) -> float:
        std_k, errors = expected_k * np.exp(logs[0]), starts * np.exp(logs[1:])
        fitted = _fit(kinds, prior_k2(std_k), list(errors), unseen * std_k**2)
        return 0.5 * logs[0] ** 2 - fitted.log_evidence

    first = np.zeros(1 + len(starts))
    simplex = np.concatenate([first[None], first + np.eye(len(first))])
    best = minimize(
        loss, first, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 0.01, "fatol": 0.01, "maxfev": 300},
    ).x  # fmt: skip
    logs = best[0] + np.linspace(-4.0, 4.0, 33)
    losses = np.array([loss(np.array([log, *best[1:]])) for log in logs])
    likely = np.exp(losses.min() - losses)
    std_k = expected_k * np.sqrt(likely @ np.exp(2.0 * logs) / likely.sum())
    return float(std_k), [float(e) for e in starts * np.exp(best[1:])]


def _fit(
    kinds: list[_Residuals],
    prior: Float[np.ndarray, "unknowns unknowns"],
    errors: list[float],
    point_k2: float,
) -> _Fitted:
    """Linear least squares: normal residuals, of which `_CORRELATED` of a pooled kind count as one."""
    known = np.linalg.inv(prior)
    gained, unlikely, left = np.zeros(len(known)), 0.0, iter(errors)
    for kind in kinds:
        pooled = kind.start is not None
        variance = kind.noise + (next(left) ** 2 if pooled else point_k2)
        count = 1.0 / _CORRELATED if pooled else 1.0
        root = np.sqrt(count / variance)[:, None]
        # What is shared is marginalised (`core.motion`).
        along, size, _ = np.linalg.svd(root * kind.shared, full_matrices=False)
        share = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
        design, residual = root * kind.design, root[:, 0] * kind.residual
        design, residual = (of - (along * share) @ (along.T @ of) for of in (design, residual))
        known = known + design.T @ design
        gained = gained + design.T @ residual
        unlikely += count * float(np.log(variance).sum()) + float(
            np.log1p(size**2).sum() + residual @ residual
        )
    covariance = np.linalg.inv(known)
    mean = covariance @ gained
    unlikely += float(np.linalg.slogdet(known)[1] + np.linalg.slogdet(prior)[1]) - float(gained @ mean)
    return _Fitted(mean, covariance, -0.5 * unlikely)


def _shared_errors(data: Observations) -> Float[np.ndarray, "shifts errors"]:
    """What the blocks' shifts share, one column for each independent error of one standard deviation."""
    columns = [block.shared_px.reshape(block.displacement_px.size, -1) for block in data.shifts]
    return np.asarray(block_diag(*columns)) if columns else np.zeros((0, 0))


def _prior_share(part: _Part) -> Float[np.ndarray, "functions functions"]:
    """Covariance of a part's coefficients, over the variance of what one view sees."""
    share = np.ones((1, 1))
    for count in part:
        place = np.linspace(0, 1, count)
        share = np.kron(share, np.exp(-np.abs(place[:, None] - place[None, :]) / LENGTH_SHARE))
    local = sum(count > 1 for count in part) > 1
    return (_LOCAL_PART if local else _PROFILE_PART) * share + 1e-6 * np.eye(len(share))


def _sensor_design(data: Observations, part: _Part) -> Float[np.ndarray, "data functions"]:
    """Derivative of the sensors' temperatures in every coefficient."""
    points = [s.position_m[np.isfinite(s.temperature_k)] for s in data.sensors]
    return _at_points(data, part, np.concatenate([np.zeros((0, 3)), *points]))


def _outlet_design(data: Observations, part: _Part) -> Float[np.ndarray, "data functions"]:
    """Derivative of the outlets' temperatures in every coefficient, as the mean at the outlet's heights.

    Windows beside walls are left out, so the correction at the outlet's own wall is an extrapolation only.
    """
    rows = [np.zeros((0, int(np.prod(part))))]
    for _, outlet, _ in data.outlets:
        patch, face = outlet.patch, face_of(outlet.patch.wall)
        box, (first, second) = data.scene.room, face.along
        steps = (np.arange(5) + 0.5) / 5
        points = np.zeros((5, 5, 3))
        points[..., face.axis] = face.place_m(box)
        points[..., first] = (patch.lower_m[0] + steps * (patch.upper_m[0] - patch.lower_m[0]))[:, None]
        points[..., second] = (patch.lower_m[1] + steps * (patch.upper_m[1] - patch.lower_m[1]))[None, :]
        row = _at_points(data, part, points.reshape(-1, 3)).mean(axis=0).reshape(part)
        rows.append(np.broadcast_to(row.mean((0, 1)), part).reshape(1, -1))
    return np.concatenate(rows)


def _at_points(
    data: Observations, part: _Part, points_m: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points functions"]:
    """A part's basis functions at points."""
    box = data.scene.room
    share = np.clip((points_m - np.asarray(box.lower_m)) / np.asarray(box.size_m), 0.0, 1.0)
    x, y, z = (_hats(count, share[:, axis]) for axis, count in enumerate(part))
    return np.einsum("pi,pj,pk->pijk", x, y, z).reshape(len(points_m), int(np.prod(part)))


def _shift_design(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    basis: Float[np.ndarray, "functions _ _ _"],
) -> Float[np.ndarray, "blocks functions"]:
    """Derivative of the blocks' shifts in every coefficient of a part."""
    air = data.scene.air
    slope = (
        -air.ambient_refractivity * air.ambient_temperature_k / (air.ambient_temperature_k + excess_k) ** 2
    )
    fields = jnp.asarray(basis * slope[None], jnp.float32)
    columns = [
        np.stack([block.pooled(d).ravel() for d in _shifts(block, fields)], axis=1) for block in data.shifts
    ]
    if not columns:
        return np.zeros((0, len(basis)))
    design = np.concatenate(columns)
    # One kelvin on the level changes the shifts by 0.7 %, far less than the model error: images do not set the level.
    return design - design.mean(axis=1, keepdims=True)


def _shifts(
    block: ShiftBlocks, fields: Float[jax.Array, "functions vx vy vz"]
) -> Float[np.ndarray, "functions windows 2"]:
    run = eqx.filter_jit(lambda operator, many: jax.lax.map(operator.apply, many))
    return np.asarray(run(block.operator, fields))


def _plane_design(
    data: Observations,
    excess_k: Float[np.ndarray, "vx vy vz"],
    basis: Float[np.ndarray, "functions _ _ _"],
) -> Float[np.ndarray, "blocks functions"]:
    """Derivative of the planes' blocks in every coefficient of a part."""
    if not data.planes:
        return np.zeros((0, len(basis)))
    return np.stack([data.plane_values(np.broadcast_to(field, excess_k.shape)) for field in basis], axis=1)
