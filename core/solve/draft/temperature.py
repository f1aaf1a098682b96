"""`draft`: temperature from the shifts and what is known of the temperature; no flow physics.

Unknown is the excess refractivity n on a vertex grid, in which the data are linear. Minimised:

    1/2 sum_w (A n - d)^T W (A n - d)                        the shifts, noise and representation error
  + 1/2 sum_v (n - n_known)^2 / std^2                        planes
  + 1/2 sum_m (mean_m n - n_mean)^2 / std^2                  outlets, sensors
  + 1/2 sum_a int (na^2 + lx^2 (dx na)^2 + ly^2 (dy na)^2 + lz^2 (dz na)^2) / sa^2      sum_a na = n - prior

One view sees integrals along its rays: across them the data decide, along them the prior (smooth: of the part na
that a view along a tells, la is long) and the known planes do. Views along several axes each have a part, with a
size of its own (`temperature_prior`). The parts are the departure from a profile over the height, which costs only
(Dz profile)^2 / step^2: pictures do not see the level, so nothing but what is known of the air may hold it.

Cost: conjugate gradients, two operator products an iteration; a few solves more for the deviations. Error:
what varies along the rays and is not on a known plane stays unseen.
"""

import time
from collections.abc import Callable

import numpy as np
from jaxtyping import Bool

from core.air import Air
from core.continuity import left_out, moved_as_air
from core.drift import nearly_still
from core.geometry import face_of
from core.known_temperature import VertexGrid, known_temperature, refuse_without_level
from core.problem import Problem, ShiftMeasurement
from core.rays.visibility import away_from_walls
from core.result import Outcome, Solution
from core.scene import ProjectedPattern
from core.shared_errors import BROAD
from core.solve.draft.conjugate_gradients import Product, conjugate_gradients
from core.solve.draft.front_layers import front_layers_px
from core.solve.draft.stratification import upside_down
from core.solve.draft.temperature_deviation import deviation
from core.solve.draft.temperature_prior import (
    TemperatureSettings,
    data_weight,
    excess,
    prior_parts,
    prior_temperature,
    profile_range_k,
    profile_weight,
)
from core.solve.draft.temperature_system import (
    ShiftOperator,
    System,
    Volume,
    preconditioner,
    steepest_slopes,
    without_shared_errors,
)
from core.watch import Row, Watch

# The hottest air that a step may reach: its refractivity is nearly zero, and a step further would make it negative.
_HOTTEST_K = 5000.0
_NOT_AIR = (
    "Some of the shifts are larger than air could make: the temperature is cut at 5000 K. Something else moved; "
    "check the drift, and that both captures show the same pattern."
)
# Lit by a projector the shift is what is left of two larger ones, each with its representation error.
_TWO_PATHS = 3.3
# Draws are solved more tightly: the broad modes, which are the uncertain ones, come last.
_DRAWN = 3e-4


def solve_temperature(
    problem: Problem,
    operators: tuple[ShiftOperator, ...],
    grid: VertexGrid,
    settings: TemperatureSettings,
    watch: Watch = Watch(),
) -> Solution:
    """Temperature on `grid`; one operator a view. Raises SettingError for contradictory knowledge."""
    started = time.perf_counter()
    air = problem.scene.air
    moved = _moved_as_air(problem)
    system, prior, shifts = _system(problem, operators, grid, settings, moved)
    inverse = preconditioner(system)
    n, history, settled = _minimise(system, inverse, shifts, prior, air, settings, watch)
    doubted = system.with_fewer_data(settings.together * _paths(problem) ** 2)
    rough = preconditioner(doubted)

    def drawn(rhs: Volume) -> Volume:
        # The field and the draws are solves of one kind, so their number says how much is done.
        done = sum("draw" in row for row in history) + 1.0
        found, _ = _solved(doubted, rough, rhs, _DRAWN, settings, watch)
        elapsed_s, share = time.perf_counter() - started, (1.0 + done) / (1.0 + BROAD + settings.draws)
        row = {"doing": "draw what may be otherwise", "draw": done, "share": share, "elapsed_s": elapsed_s}
        history.append(row)
        watch.tell(row)
        return found

    temperature = _kelvin(air, n)
    std_k = shared_k = None
    if settings.draws:
        # dT = (T / T0)^2 dn T0 / N0.
        scale = (temperature / air.ambient_temperature_k) ** 2 / system.per_k
        std, shared = deviation(doubted, drawn, settings.draws)
        std_k, shared_k = scale * std, scale[..., None] * shared
    turned = upside_down(
        temperature, doubted, lambda rhs: _solved(doubted, rough, rhs, _DRAWN, settings, watch)[0]
    )
    x, y, z = grid.axes_m
    return Solution(
        x_m=x,
        y_m=y,
        z_m=z,
        temperature_k=temperature,
        temperature_std_k=std_k,
        temperature_shared_k=shared_k,
        outcome=Outcome.converged if settled else Outcome.step_limit,
        solver_s=time.perf_counter() - started,
        history=tuple(history),
        notes=(
            "Temperature only: velocity and pressure are not solved for by this preset.",
            "What varies along the line of sight comes from the prior, not from the images.",
            *left_out(moved),
            *turned,
            *([_NOT_AIR] if (n < _thinnest(air) - air.ambient_refractivity).any() else []),
        ),
    )


def _moved_as_air(problem: Problem) -> list[Bool[np.ndarray, " _"]]:
    """Each view's windows that moved as air does."""
    return [
        moved_as_air(shift, away_from_walls(problem.scene, view, shift.centres_px, 0.0))
        for view, shift in enumerate(problem.shifts)
    ]


def _kelvin(air: Air, n: Volume) -> Volume:
    """Temperature of air of this excess refractivity, at most the hottest."""
    index = np.maximum(n + air.ambient_refractivity, _thinnest(air))
    return air.ambient_refractivity * air.ambient_temperature_k / index


def _thinnest(air: Air) -> float:
    """Refractivity of the hottest air."""
    return air.ambient_refractivity * air.ambient_temperature_k / _HOTTEST_K


def _system(
    problem: Problem,
    operators: tuple[ShiftOperator, ...],
    grid: VertexGrid,
    settings: TemperatureSettings,
    moved: list[Bool[np.ndarray, " _"]],
) -> tuple[System, Volume, tuple[ShiftMeasurement, ...]]:
    """The quadratic problem, the prior as excess refractivity, and the shifts without the camera's motion.

    `moved`: each view's windows that moved as air does; the others do not count.
    """
    air = problem.scene.air
    known = known_temperature(problem, grid)
    refuse_without_level(known)
    # Kelvin to excess refractivity at ambient: only scales weights, never values.
    per_k = air.ambient_refractivity / air.ambient_temperature_k
    prior = excess(air, prior_temperature(problem, known, grid) - air.ambient_temperature_k)
    representation = _paths(problem) * settings.representation
    weights = tuple(
        data_weight(nearly_still(shift), representation) * as_air[:, None, None]
        for shift, as_air in zip(problem.shifts, moved, strict=True)
    )
    rays = operators
    layers_px = front_layers_px(problem, rays, grid, per_k)
    still = [without_shared_errors(*of) for of in zip(rays, problem.shifts, weights, layers_px, strict=True)]
    operators, shifts = tuple(operator for operator, _ in still), tuple(shift for _, shift in still)
    along = tuple(face_of(view.wall).axis for view in problem.scene.views[: len(operators)])
    system = System(
        grid,
        operators,
        along,
        rays,
        weights,
        known,
        per_k,
        prior_parts(operators, along, weights, shifts, prior, grid, settings),
        steepest_slopes(problem.scene),
        profile_weight(per_k * profile_range_k(problem), grid),
    )
    return system, prior, shifts


def _paths(problem: Problem) -> float:
    return _TWO_PATHS if isinstance(problem.scene.light, ProjectedPattern) else 1.0


def _minimise(
    system: System,
    inverse: Product,
    shifts: tuple[ShiftMeasurement, ...],
    prior: Volume,
    air: Air,
    settings: TemperatureSettings,
    watch: Watch,
) -> tuple[Volume, list[Row], bool]:
    """Conjugate gradients on the departure from the prior."""
    began_s = time.perf_counter()
    history: list[Row] = []
    x, y, z = system.grid.axes_m

    def record(change: Volume) -> None:
        change_k, elapsed_s = float(np.abs(change).max() / system.per_k), time.perf_counter() - began_s
        row = {"doing": "fit the temperature", "iteration": len(history) + 1.0, "change": change_k}
        history.append({**row, "elapsed_s": elapsed_s})
        n = prior + change
        watch.tell(history[-1], lambda: Solution(x, y, z, _kelvin(air, n), outcome=Outcome.step_limit))

    rhs = _right_hand_side(system, shifts, prior, air)
    found, settled = _solved(system, inverse, rhs, settings.tolerance, settings, watch, record)
    return prior + found, history, settled


def _right_hand_side(system: System, shifts: tuple[ShiftMeasurement, ...], prior: Volume, air: Air) -> Volume:
    """Minus the gradient at the prior."""
    known, ambient = system.known, air.ambient_temperature_k
    rhs = -system.data_terms(prior) - system.known_terms(prior)
    for operator, weight, shift in zip(system.operators, system.weights, shifts, strict=True):
        rhs += operator.transpose(np.einsum("wab,wb->wa", weight, shift.displacement_px))
    target = excess(air, np.where(known.mask, known.temperature_k, ambient) - ambient)
    rhs[known.mask] += (target / (known.std_k * system.per_k) ** 2)[known.mask]
    for members, kelvin, std in known.means:
        value = float(excess(air, np.array(kelvin - ambient)))
        rhs.reshape(-1)[members] += value / (len(members) * (std * system.per_k) ** 2)
    return rhs


def _solved(
    system: System,
    inverse: Product,
    rhs: Volume,
    tolerance: float,
    settings: TemperatureSettings,
    watch: Watch,
    record: Callable[[Volume], object] = lambda found: None,
) -> tuple[Volume, bool]:
    """The Hessian's inverse times `rhs`, and whether it was reached. Raises StoppedError between two products."""

    def hessian(n: Volume) -> Volume:
        watch.check_stop()
        return system.data_terms(n) + system.known_terms(n) + system.smooth(n)

    return conjugate_gradients(hessian, inverse, rhs, tolerance, settings.max_iterations, record)
