"""The prior of `draft`, and the weights of its windows.

What is known of the air (`core.known_temperature`) gives the level, and the profile over height is free within the
range of the air that is known.

Departures from that are the sum of independent parts, one for each axis that views look along: a part varies slowly
along its axis. The sizes of the parts are those at which smooth random fields move each view's pattern as far as it
has moved (moment matching). So a cool room gets a small prior, broad fields, which a projector beside the camera
hardly sees, stay near the prior, and what one view sees of a jet does not make the others take noise for air.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter
from scipy.optimize import nnls

from core.air import Air
from core.data_error import CORRELATED_DATA, REPRESENTATION
from core.known_temperature import EVEN_STD, KnownTemperature, VertexGrid, known_air_k, planes_ends_k
from core.motion import without_motion
from core.problem import Problem, ShiftMeasurement
from core.setting import setting
from core.solve.draft.temperature_system import AirPart, ShiftOperator, Volume

# A thousandth of a kelvin, as excess refractivity.
_LEAST_SIZE = 1e-9
_LEAST_RANGE_K = 0.1
# A profile rises by something between nothing and the range of the air that is known: the mean of that.
_RISE = 0.5
_DRAWS = 4
# A shared error may have any size if its deviation is so many times the stated one.
_ANY = 1e4
_TINY = float(np.finfo(float).tiny)


@setting
class TemperatureSettings:
    """Lengths over which the air varies, in parts of the room's longest edge, and when to stop.

    `across` and `along` are across and along the view; `representation` is the part of the shift's size
    that this grid cannot represent, added to the noise. The deviations come from `draws` draws of the
    posterior (none: no deviations), but for those of the mean and the rise (`temperature_deviation`). There so many
    windows count as one: what a grid cannot represent is wrong in neighbouring windows alike.
    """

    across: float = 0.04
    along: float = 0.5
    representation: float = REPRESENTATION
    tolerance: float = 1e-3
    max_iterations: int = 400
    draws: int = 6
    together: float = CORRELATED_DATA


def profile_weight(reach: float, grid: VertexGrid) -> float:
    """One over the variance of the profile's step from one height to the next, as of a random walk."""
    return (grid.shape[2] - 1) / (EVEN_STD * reach) ** 2


def prior_temperature(problem: Problem, known: KnownTemperature, grid: VertexGrid) -> Volume:
    """The level of what is known, rising over the height by half of the range of the air that is known.

    Warm air lies on cold. Images do not see the level, so a prior of the size that they give must not pull it.
    """
    known_k = known_air_k(problem) + planes_ends_k(problem)
    rise_k = _RISE * float(np.ptp(known_k)) if known_k else 0.0
    rising_k = np.broadcast_to(rise_k * np.linspace(-0.5, 0.5, grid.shape[2]), grid.shape)
    above_k = [kelvin - rising_k.reshape(-1)[members].mean() for members, kelvin, _ in known.means]
    weights = [std**-2 for _, _, std in known.means]
    if known.mask.any():
        above_k.append(float(np.mean(known.temperature_k[known.mask] - rising_k[known.mask])))
        weights.append(float(np.mean(known.std_k[known.mask] ** -2)))
    return rising_k + float(np.average(above_k, weights=weights))


def profile_range_k(problem: Problem) -> float:
    """From the coldest to the hottest that is known, planes too: the most that a profile over height may span."""
    kelvin = known_air_k(problem) + planes_ends_k(problem)
    if len(kelvin) < 2:
        kelvin.append(problem.scene.air.ambient_temperature_k)
    return max(max(kelvin) - min(kelvin), _LEAST_RANGE_K)


def thinned(count: int) -> int:
    """So many vertices are enough, of as many across, along an axis along which the air varies slowly."""
    return max(9, (count + 2) // 3)


def prior_parts(
    operators: tuple[ShiftOperator, ...],
    along: tuple[int, ...],
    weights: tuple[Float[np.ndarray, "_ 2 2"], ...],
    shifts: tuple[ShiftMeasurement, ...],
    prior: Volume,
    grid: VertexGrid,
    settings: TemperatureSettings,
) -> tuple[AirPart, ...]:
    """The parts of n - prior, one for each axis that views look along; `along` is each view's.

    A part's size is that at which it moves its views' patterns as far as they moved beyond their noise, and beyond
    what the other parts move them.
    """
    axes = sorted(set(along))
    lengths = [lengths_m(grid, settings, axis) for axis in axes]
    beyond, noise, moved = _powers(operators, weights, shifts, prior, grid, lengths)
    squares, _ = nnls(moved / noise[:, None], beyond / noise)
    parts = []
    for number, (axis, reach) in enumerate(zip(axes, lengths, strict=True)):
        own = np.array(along) == axis
        # At least a tenth of what noise alone gives: a size of zero would forbid every departure.
        least = 0.01 * noise[own].sum() / max(moved[own, number].sum(), _TINY)
        square = max(squares[number], least, _LEAST_SIZE**2)
        # A room's worth of independent values: one a hundred vertices, of a grid that is thinned along the view.
        fewer = 1.0 if len(axes) == 1 else thinned(grid.shape[axis]) / grid.shape[axis]
        mass = 0.01 * fewer / square
        x, y, z = (mass * (length / h) ** 2 for length, h in zip(reach, grid.spacing_m, strict=True))
        parts.append(AirPart(mass, (x, y, z)))
    return tuple(parts)


def _powers(
    operators: tuple[ShiftOperator, ...],
    weights: tuple[Float[np.ndarray, "_ 2 2"], ...],
    shifts: tuple[ShiftMeasurement, ...],
    prior: Volume,
    grid: VertexGrid,
    lengths: list[tuple[float, float, float]],
) -> tuple[Float[np.ndarray, " views"], Float[np.ndarray, " views"], Float[np.ndarray, "views parts"]]:
    """Of each view's shifts: what they have beyond noise, their noise, and what a part of size 1 adds.

    What a motion of the camera would make does not count, however large: where its reading is wrong it is no air.
    """
    random = np.random.default_rng(0)
    parts = []
    for reach in lengths:
        sigma = [length / h for length, h in zip(reach, grid.spacing_m, strict=True)]
        draws = [
            gaussian_filter(random.standard_normal(grid.shape), sigma, mode="reflect") for _ in range(_DRAWS)
        ]
        parts.append([draw / draw.std() for draw in draws])
    rows = []
    for operator, weight, shift in zip(operators, weights, shifts, strict=True):
        used = weight[:, 0, 0] > 0
        spread = np.linalg.cholesky(np.linalg.inv(shift.information_per_px2[used]))
        noise = _most(np.einsum("wab,wb->wa", spread, random.standard_normal((used.sum(), 2))))
        still = _without_any_motion(shift, weight)
        seen = _most(still(shift.displacement_px - operator.apply(prior))[used])
        moved = [np.mean([_most(still(operator.apply(draw))[used]) for draw in draws]) for draws in parts]
        rows.append([seen - noise, max(noise, _TINY), *moved])
    beyond, noises, *of_parts = np.array(rows).T
    return beyond, noises, np.stack(of_parts, axis=1)


def _without_any_motion(
    shift: ShiftMeasurement, weight: Float[np.ndarray, "windows 2 2"]
) -> Callable[[Float[np.ndarray, "windows 2"]], Float[np.ndarray, "windows 2"]]:
    """Takes out of shifts what a motion of the camera would make, of any size."""
    errors_px = shift.common_errors_px
    return (lambda of: of) if errors_px is None else without_motion(_ANY * errors_px, weight).apply


def _most(shifts_px: Float[np.ndarray, "windows 2"]) -> float:
    """Sum of squares without the largest tenth, which are thermal layers at walls."""
    squares = np.sum(shifts_px**2, axis=1)
    return float(squares[squares <= np.percentile(squares, 90)].sum()) if len(squares) else 0.0


def lengths_m(grid: VertexGrid, settings: TemperatureSettings, along: int) -> tuple[float, float, float]:
    """Correlation lengths along x, y, z [m] of a part: long along the axis that is looked along."""
    longest_m = max(grid.box.size_m)
    x, y, z = (longest_m * (settings.along if axis == along else settings.across) for axis in range(3))
    return x, y, z


def excess(air: Air, excess_k: np.ndarray) -> np.ndarray:
    """`Air.excess_refractivity` in float64, whatever JAX is set to."""
    return np.asarray(-air.ambient_refractivity * excess_k / (air.ambient_temperature_k + excess_k))


def data_weight(shift: ShiftMeasurement, representation: float) -> Float[np.ndarray, "windows 2 2"]:
    """Inverse covariance of noise and representation error; zero for outliers."""
    size = np.linalg.norm(shift.displacement_px, axis=1)
    covariance = np.linalg.inv(shift.information_per_px2)
    informed = np.trace(covariance, axis1=1, axis2=2) < 1.0
    typical = float(np.sqrt(np.mean(np.minimum(size, np.percentile(size, 90)) ** 2)))
    weight = np.linalg.inv(covariance + (representation * typical) ** 2 * np.eye(2))
    # Beside a thermal layer thinner than a cell the pattern moves many times further: this grid cannot represent it.
    outlier = size > 12 * typical + 6 * np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    return weight * (informed & ~outlier)[:, None, None]
