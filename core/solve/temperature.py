"""`draft`: temperature from the shifts and what is known of the temperature; no flow physics.

Unknown is the excess refractivity n on a vertex grid, in which the data are linear. Minimised:

    1/2 sum_w (A n - d)^T W (A n - d)                        the shifts, noise and representation error
  + 1/2 sum_v (n - n_known)^2 / std^2                        planes, inlets, heaters
  + 1/2 sum_m (mean_m n - n_mean)^2 / std^2                  outlets, sensors
  + 1/2 int (n'^2 + lx^2 (dx n')^2 + ly^2 (dy n')^2 + lz^2 (dz n')^2) / s^2      n' = n - prior

One view sees integrals along its rays: across them the data decide, along them the prior (smooth: ly is
long) and the known planes do. The prior is the known plane's profile over height carried away from its
wall, or nothing. Its size s is the one at which smooth random fields move the pattern as far as it moved
(moment matching): a cool room is not given a hot room's freedom, and a projector beside the camera, which
hardly sees broad fields, is not believed about them.

Cost: conjugate gradients, two operator products an iteration, preconditioned by the smoothness term and
the mean data term, which are diagonal under the cosine transform. Error: what varies along the rays and
is not on a known plane stays unseen.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter
from scipy.sparse.linalg import LinearOperator, cg

from core.air import Air
from core.knowledge import KnownTemperature, VertexGrid, known_temperature, plane_on_grid, wall_index
from core.problem import Problem, ShiftMeasurement
from core.result import Outcome, Solution
from core.scene import ProjectedPattern, Scene
from core.setting import SettingError, setting

Volume = Float[np.ndarray, "nx ny nz"]
OnEvent = Callable[[dict[str, Any]], object]


@runtime_checkable
class ShiftOperator(Protocol):
    """The linear map from excess refractivity on vertices to displacements, and its transpose."""

    def apply(self, values: Volume) -> Float[np.ndarray, "windows 2"]:
        """Displacement [px] of every window."""
        ...

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Volume:
        """The transposed map."""
        ...


# Thinner air than at this temperature is none: without a limit 0 K comes next, and then less.
_HOTTEST_K = 5000.0
_NOT_AIR = (
    "Some of the shifts are larger than air could make: the temperature is cut at 5000 K. Something else moved; "
    "check the drift, and that both captures show the same pattern."
)
# A thousandth of a kelvin, as excess refractivity.
_LEAST_SIZE = 1e-9
_DRAWS = 4
# Lit by a projector the shift is what is left of two larger ones, each with its representation error.
_TWO_PATHS = 3.3


@setting
class TemperatureSettings:
    """Lengths over which the air varies, in parts of the room's longest edge, and when to stop.

    `across` and `along` are across and along the view; `representation` is the part of the shift's size
    that this grid cannot represent, added to the noise.
    """

    across: float = 0.04
    along: float = 0.5
    representation: float = 0.3
    tolerance: float = 1e-3
    max_iterations: int = 400


@dataclass(frozen=True)
class _System:
    """The quadratic problem in n, flattened."""

    grid: VertexGrid
    operators: tuple[ShiftOperator, ...]
    weights: tuple[Float[np.ndarray, "windows 2 2"], ...]
    known: KnownTemperature
    per_k: float
    stiffness: tuple[float, float, float]
    mass: float
    slopes: tuple[float, float]

    def smooth(self, n: Volume) -> Volume:
        """Gradient of the prior's terms: size and smoothness."""
        total = self.mass * n
        for axis, factor in enumerate(self.stiffness):
            difference = factor * np.diff(n, axis=axis)
            low = [slice(None)] * 3
            high = [slice(None)] * 3
            low[axis], high[axis] = slice(None, -1), slice(1, None)
            total[tuple(low)] -= difference
            total[tuple(high)] += difference
        return total

    def known_terms(self, n: Volume) -> Volume:
        """Hessian of the known values and means, times n."""
        total = np.zeros_like(n)
        mask = self.known.mask
        total[mask] = n[mask] / (self.known.std_k[mask] * self.per_k) ** 2
        flat = total.reshape(-1)
        for members, _, std in self.known.means:
            flat[members] += n.reshape(-1)[members].mean() / (len(members) * (std * self.per_k) ** 2)
        return total

    def data_terms(self, n: Volume) -> Volume:
        """Hessian of the data, times n."""
        total = np.zeros_like(n)
        for operator, weight in zip(self.operators, self.weights, strict=True):
            total += operator.transpose(np.einsum("wab,wb->wa", weight, operator.apply(n)))
        return total


def solve_temperature(
    problem: Problem,
    operators: tuple[ShiftOperator, ...],
    grid: VertexGrid,
    settings: TemperatureSettings,
    on_event: OnEvent | None = None,
) -> Solution:
    """Temperature on `grid`; one operator a view. Raises SettingError for contradictory knowledge."""
    started = time.perf_counter()
    air = problem.scene.air
    known = known_temperature(problem, grid)
    if not known.mask.any() and not known.means:
        raise SettingError(
            "Nothing fixes the level of the temperature: deflections see only gradients. "
            "Add an inlet, a plane field, an outlet's mean temperature, or a point sensor to the scene."
        )
    # Kelvin to excess refractivity at ambient: only scales weights, never values.
    per_k = air.ambient_refractivity / air.ambient_temperature_k
    prior_k = prior_temperature(problem, grid)
    prior = _excess(air, prior_k + _level_k(known, prior_k) - air.ambient_temperature_k)
    paths = _TWO_PATHS if isinstance(problem.scene.light, ProjectedPattern) else 1.0
    weights = tuple(data_weight(s, paths * settings.representation) for s in problem.shifts)
    size = prior_size(operators, weights, problem.shifts, prior, grid, settings)
    # A room's worth of independent values: one a hundred vertices.
    mass = 0.01 / size**2
    lengths = _lengths_m(grid, settings)
    stiff = [mass * (length / h) ** 2 for length, h in zip(lengths, grid.spacing_m, strict=True)]
    stiffness = (stiff[0], stiff[1], stiff[2])
    slopes = steepest_slopes(problem.scene)
    # Without a plane nobody knows the profile: only its slopes are believed, not its size.
    held = mass if problem.planes else 1e-3 * mass
    system = _System(grid, operators, weights, known, per_k, stiffness, held, slopes)
    n, iterations, settled = _minimise(system, problem.shifts, prior, air, settings, on_event)
    index = n + air.ambient_refractivity
    thinnest = air.ambient_refractivity * air.ambient_temperature_k / _HOTTEST_K
    temperature = air.ambient_refractivity * air.ambient_temperature_k / np.maximum(index, thinnest)
    x, y, z = grid.axes_m
    return Solution(
        x_m=x,
        y_m=y,
        z_m=z,
        temperature_k=temperature,
        outcome=Outcome.converged if settled else Outcome.step_limit,
        solver_s=time.perf_counter() - started,
        history=iterations,
        notes=(
            "Temperature only: velocity and pressure are not solved for by this preset.",
            "What varies along the line of sight comes from the prior, not from the images.",
            *([_NOT_AIR] if (index < thinnest).any() else []),
        ),
    )


def _level_k(known: KnownTemperature, prior_k: Volume) -> float:
    """What thermometers and outlets read above the prior, where no plane says how warm the room is.

    Pictures do not see the level, and the prior's size is theirs: it must not pull the level to ambient.
    """
    if known.mask.any() or not known.means:
        return 0.0
    weights = np.array([std**-2 for _, _, std in known.means])
    above = [kelvin - float(prior_k.reshape(-1)[members].mean()) for members, kelvin, _ in known.means]
    return float(np.average(above, weights=weights))


def prior_temperature(problem: Problem, grid: VertexGrid) -> Volume:
    """The first known plane's profile over height carried through the room; without a plane the outlets' and
    sensors' mean, and ambient where there are none.

    Only the profile is carried: a jet in the plane is somewhere else a metre further on.
    """
    # What leaves the room has its mean temperature: without it the prior would draw a warm room to ambient.
    measured = [kelvin for _, kelvin, _ in known_temperature(problem, grid).means]
    level = float(np.mean(measured)) if measured else problem.scene.air.ambient_temperature_k
    volume = np.full(grid.shape, level)
    for plane in problem.planes[:1]:
        axis, _ = wall_index(plane.wall)  # type: ignore[arg-type]
        on_grid = np.expand_dims(plane_on_grid(grid, plane, plane.temperature_k), axis)
        volume[...] = np.median(on_grid, axis=(0, 1), keepdims=True)
    return volume


def prior_size(
    operators: tuple[ShiftOperator, ...],
    weights: tuple[Float[np.ndarray, "windows 2 2"], ...],
    shifts: tuple[ShiftMeasurement, ...],
    prior: Volume,
    grid: VertexGrid,
    settings: TemperatureSettings,
) -> float:
    """Rms of n - prior at which smooth random fields move the pattern as far as it moved beyond its noise."""
    random = np.random.default_rng(0)
    sigma = [length / h for length, h in zip(_lengths_m(grid, settings), grid.spacing_m, strict=True)]
    unit, seen, noise = 0.0, 0.0, 0.0
    draws = [
        gaussian_filter(random.standard_normal(grid.shape), sigma, mode="reflect") for _ in range(_DRAWS)
    ]
    for operator, weight, shift in zip(operators, weights, shifts, strict=True):
        used = weight[:, 0, 0] > 0
        spread = np.linalg.cholesky(np.linalg.inv(shift.information_per_px2[used]))
        drawn = np.einsum("wab,wb->wa", spread, random.standard_normal((used.sum(), 2)))
        noise += _most(drawn)
        seen += _most((shift.displacement_px - operator.apply(prior))[used])
        unit += float(np.mean([_most(operator.apply(d / d.std())[used]) for d in draws]))
    if unit == 0.0:
        return _LEAST_SIZE
    # No less than a tenth of what noise alone would look like: zero would forbid every departure.
    return max(float(np.sqrt(max(seen - noise, 0.01 * noise) / unit)), _LEAST_SIZE)


def _most(shifts_px: Float[np.ndarray, "windows 2"]) -> float:
    """Sum of squares without the largest tenth: thermal layers move the pattern more than the room's air."""
    squares = np.sum(shifts_px**2, axis=1)
    return float(squares[squares <= np.percentile(squares, 90)].sum()) if len(squares) else 0.0


def _lengths_m(grid: VertexGrid, settings: TemperatureSettings) -> tuple[float, float, float]:
    longest_m = max(grid.box.size_m)
    return settings.across * longest_m, settings.along * longest_m, settings.across * longest_m


def _excess(air: Air, excess_k: np.ndarray) -> np.ndarray:
    """`Air.excess_refractivity` in float64, whatever JAX is set to."""
    return np.asarray(-air.ambient_refractivity * excess_k / (air.ambient_temperature_k + excess_k))


def data_weight(shift: ShiftMeasurement, representation: float) -> Float[np.ndarray, "windows 2 2"]:
    """Inverse covariance of noise and representation error; zero for windows far outside the rest."""
    size = np.linalg.norm(shift.displacement_px, axis=1)
    covariance = np.linalg.inv(shift.information_per_px2)
    informed = np.trace(covariance, axis1=1, axis2=2) < 1.0
    typical = float(np.sqrt(np.mean(np.minimum(size, np.percentile(size, 90)) ** 2)))
    weight = np.linalg.inv(covariance + (representation * typical) ** 2 * np.eye(2))
    # Beside a wall with a thermal layer inside a cell the pattern moves many times further: not this grid's.
    outlier = size > 12 * typical + 6 * np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    return weight * (informed & ~outlier)[:, None, None]


def _minimise(
    system: _System,
    shifts: tuple[ShiftMeasurement, ...],
    prior: Volume,
    air: Air,
    settings: TemperatureSettings,
    on_event: OnEvent | None,
) -> tuple[Volume, tuple[dict[str, float], ...], bool]:
    """Conjugate gradients on the departure from the prior."""
    shape, known = system.grid.shape, system.known
    rhs = -system.data_terms(prior) - system.known_terms(prior)
    for operator, weight, shift in zip(system.operators, system.weights, shifts, strict=True):
        rhs += operator.transpose(np.einsum("wab,wb->wa", weight, shift.displacement_px))
    ambient = air.ambient_temperature_k
    target = _excess(air, np.where(known.mask, known.temperature_k, ambient) - ambient)
    rhs[known.mask] += (target / (known.std_k * system.per_k) ** 2)[known.mask]
    for members, kelvin, std in known.means:
        value = float(_excess(air, np.array(kelvin - ambient)))
        rhs.reshape(-1)[members] += value / (len(members) * (std * system.per_k) ** 2)

    def hessian(flat: np.ndarray) -> np.ndarray:
        n = flat.reshape(shape)
        return (system.data_terms(n) + system.known_terms(n) + system.smooth(n)).ravel()

    history: list[dict[str, float]] = []

    def record(flat: np.ndarray) -> None:
        history.append({"iteration": len(history) + 1.0, "change": float(np.abs(flat).max() / system.per_k)})
        if on_event:
            n = (prior + flat.reshape(shape))[:, shape[1] // 2]
            plane = -ambient * n / (air.ambient_refractivity + n)
            on_event({**history[-1], "excess_plane_k": plane.astype(np.float32)})

    size = int(np.prod(shape))
    found, info = cg(
        _operator(hessian, size),
        rhs.ravel(),
        rtol=settings.tolerance,
        maxiter=settings.max_iterations,
        M=_preconditioner(system),
        callback=record,
    )
    return prior + found.reshape(shape), tuple(history), info == 0


def _preconditioner(system: _System) -> LinearOperator:
    """Inverse of a separable stand-in: eigenvectors along x and z, a dense system along the view y.

    The stand-in is data = (Lx / hx^2 + Lz / hz^2) (x) W, with the levers W of the slabs measured on the
    operators themselves. Rays of a perspective view cross a wave at other phases from slab to slab, by up
    to their slope: the mean over the slopes makes a sinc of W's off-diagonals. Known planes pin their wall.
    """
    shape, spacing = system.grid.shape, system.grid.spacing_m
    fx, fy, fz = system.stiffness
    (lx, qx, dx), (lz, qz, dz) = (_modes(system, axis) for axis in (0, 2))
    levers = _slab_levers(system)
    smooth = fx * lx[:, None] + fz * lz[None]
    across = dx[:, None] / spacing[0] ** 2 + dz[None] / spacing[2] ** 2
    matrices = (
        (smooth[..., None, None] + system.mass) * np.eye(shape[1])
        + fy * _laplacian(shape[1])
        + across[..., None, None] * levers * _coherence(system)
    )
    inverses = np.linalg.inv(matrices)

    def apply(flat: np.ndarray) -> np.ndarray:
        modes = np.einsum("xi,xyz,zk->iky", qx, flat.reshape(shape), qz, optimize=True)
        modes = (inverses @ modes[..., None])[..., 0]
        return np.einsum("xi,iky,zk->xyz", qx, modes, qz, optimize=True).ravel()

    size = int(np.prod(shape))
    return _operator(apply, size)


def _coherence(system: _System) -> Float[np.ndarray, "nx nz ny ny"]:
    """Mean over the view's slopes of the phase between two slabs, for each pair of waves along x and z."""
    y_m = system.grid.axes_m[1]
    apart_m = y_m[:, None] - y_m[None]
    factors = []
    for axis in (0, 2):
        waves_per_m = np.arange(system.grid.shape[axis]) / (2 * system.grid.box.size_m[axis])
        factors.append(np.sinc(2 * waves_per_m[:, None, None] * system.slopes[axis // 2] * apart_m))
    return factors[0][:, None] * factors[1][None]


def steepest_slopes(scene: Scene) -> tuple[float, float]:
    """Largest slope of a camera ray against the view's axis y that meets the back wall, along x and z."""
    room = scene.room
    slopes = []
    for axis in (0, 2):
        reach = [
            abs(end - view.camera.position_m[axis]) / (room.upper_m[1] - view.camera.position_m[1])
            for view in scene.views
            for end in (room.lower_m[axis], room.upper_m[axis])
        ]
        slopes.append(max(reach))
    return slopes[0], slopes[1]


def _laplacian(n: int) -> Float[np.ndarray, "n n"]:
    """Second differences of a line with free ends, positive."""
    laplacian = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    laplacian[0, 0] = laplacian[-1, -1] = 1.0
    return laplacian


def _operator(product: Callable[[np.ndarray], np.ndarray], size: int) -> LinearOperator:
    return LinearOperator((size, size), matvec=product, dtype=np.float64)  # type: ignore[call-arg]


def _modes(
    system: _System, axis: int
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"], Float[np.ndarray, " n"]]:
    """Modes along an axis whose known end planes are pinned: smoothness, vectors, unpinned curvature."""
    laplacian = _laplacian(system.grid.shape[axis])
    pinned = laplacian.copy()
    mask, std = (np.moveaxis(v, axis, 0) for v in (system.known.mask, system.known.std_k))
    for end in (0, -1):
        if mask[end].mean() > 0.5:
            weight = np.mean(1 / (std[end][mask[end]] * system.per_k) ** 2)
            pinned[end, end] += weight / system.stiffness[axis]
    values, vectors = np.linalg.eigh(pinned)
    return values, vectors, np.einsum("ai,ab,bi->i", vectors, laplacian, vectors)


def _slab_levers(system: _System) -> Float[np.ndarray, "ny ny"]:
    """Hessian of the data for a unit gradient across the view, slab by slab along y, a vertex of the face."""
    shape, spacing = system.grid.shape, system.grid.spacing_m
    total = np.zeros((shape[1], shape[1]))
    for operator, weight in zip(system.operators, system.weights, strict=True):
        shifts = []
        for j in range(shape[1]):
            ramp = np.zeros(shape)
            ramp[:, j, :] = (np.arange(shape[0]) * spacing[0])[:, None]
            shifts.append(operator.apply(ramp))
        stacked = np.stack(shifts)
        total += np.einsum("iwa,wab,jwb->ij", stacked, weight, stacked, optimize=True)
    return total / (shape[0] * shape[2])
