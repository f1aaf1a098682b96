"""What a fitted room says: T, p and u with the last correction, their deviations, and sentences."""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid

from core.air import GRAVITY_M_S2
from core.problem import Problem
from core.result import Solution
from core.room.fit import Posterior
from core.room.grid import AXES, WALLS
from core.room.observe import Observations, Prediction
from core.room.prior import Prior
from core.room.residue import Correction, temperature_correction
from core.room.runs import DIFFERENCE, Attempt
from core.room.sentences import balances, contradictions, misfit, undetermined
from core.room.setup import RoomLayout
from core.uncertainty import Deviation, Represented, deviation

# Taken for the share of the images that is left unexplained where there are none.
_UNSEEN_SHARE = 0.3
# What grid, closure and scale leave open (a, c and b of `core.uncertainty`).
_SHARES = {"excess_k": (0.1, 1.0, 0.2), "pressure_m2_s2": (0.3, 2.0, 5.0), "velocity_m_s": (0.5, 2.0, 0.38)}


class Solved(eqx.Module):
    """Everything that a solve leaves behind: what a solution and its deviations are made of.

    `before` is the room that parameters alone make, `best` the same with its level, or profile, held.
    """

    problem: Problem
    data: Observations
    prior: Prior
    posterior: Posterior
    runs: list[Prediction]
    other: Prediction
    first: Prediction
    before: Attempt
    best: Attempt
    layout: RoomLayout


def solution(solved: Solved, seconds: float, *, use_images: bool, notes: tuple[str, ...] = ()) -> Solution:
    """The room as a result, with the temperature's last correction, deviations and sentences after `notes`."""
    best, box, problem = solved.best, solved.problem.scene.room, solved.problem
    values, _, _ = solved.data.values()
    residual = values - solved.data.predicted(best.seen)
    local_k = departure(best.seen.excess_k)
    free = free_vertices(solved.layout, best.seen.excess_k.shape)
    start = unheld(best.seen, solved.before.seen, solved.data, solved.prior, free)
    change = last_correction(solved.data, solved.prior, solved.runs, start)
    excess = start.excess_k + (change.excess_k[:, None, :] * free if use_images else 0.0)
    variances = (change.prior_variance_k2[:, None, :] * free, change.variance_k2[:, None, :] * free)
    share = unexplained(solved.data, residual, values)
    temperature = _deviation(solved, "excess_k", local_k, share, variances)
    pressure = _deviation(solved, "pressure_m2_s2", departure(best.seen.pressure_m2_s2), share)
    velocity = _deviation(solved, "velocity_m_s", rms(best.seen.velocity_m_s), share)
    x, y, z = (np.linspace(box.lower_m[a], box.upper_m[a], n) for a, n in enumerate(excess.shape))
    return Solution(
        x,
        y,
        z,
        problem.scene.air.ambient_temperature_k + excess,
        best.seen.pressure_m2_s2 + carried_m2_s2(problem, z, excess - best.seen.excess_k),
        best.seen.velocity_m_s,
        temperature.std,
        pressure.std,
        velocity.std,
        temperature.informed,
        outcome=best.flow.outcome,
        solver_s=seconds,
        notes=(*notes, *sentences(solved, residual, values)),
    )


def last_correction(data: Observations, prior: Prior, runs: list[Prediction], seen: Prediction) -> Correction:
    """The correction of T by all that parameters leave unexplained."""
    own_k = departure(seen.excess_k)
    level_k = max(own_k, level_std_k(runs))
    residual = data.values()[0] - data.predicted(seen)
    return temperature_correction(data, seen.excess_k, residual, own_k, level_k, unknown_walls(prior))


def unheld(
    held: Prediction,
    before: Prediction,
    data: Observations,
    prior: Prior,
    free: Float[np.ndarray, "vx vy vz"],
) -> Prediction:
    """A room that was held, at the level (or profile) it had before: a correction is of what the model says."""
    shift_k = layer_means(held.excess_k) - layer_means(before.excess_k)
    if not unknown_walls(prior):
        shift_k = np.full_like(shift_k, shift_k.mean())
    outflow_k, box = held.outflow_excess_k, data.scene.room
    for outlet in data.outlets:
        patch = outlet.patch
        ends_m = {"z_min": box.lower_m[2], "z_max": box.upper_m[2]}
        height_m = ends_m.get(patch.wall, 0.5 * (patch.lower_m[1] + patch.upper_m[1]))
        heights_m = np.linspace(box.lower_m[2], box.upper_m[2], len(shift_k))
        outflow_k -= float(np.interp(height_m, heights_m, shift_k))
    return Prediction(held.excess_k - shift_k * free, held.pressure_m2_s2, held.velocity_m_s, outflow_k)


def to_hold_k(
    data: Observations,
    prior: Prior,
    runs: list[Prediction],
    held: Attempt,
    before: Attempt,
    layout: RoomLayout,
) -> Float[np.ndarray, " layers"]:
    """Corrected mean excess temperature of the room `before` it was held; `held` says its departures.

    Where walls are unknown that of every layer of cells: then the room's own profile is no better than they.
    """
    free = free_vertices(layout, held.seen.excess_k.shape)
    start = unheld(held.seen, before.seen, data, prior, free)
    change = last_correction(data, prior, runs, start).excess_k[:, None, :] * free
    warmer_k = layer_means(start.excess_k + change) - layer_means(held.seen.excess_k)
    faces_m = layout.grid.faces_m(2)
    heights_m = np.linspace(faces_m[0], faces_m[-1], len(warmer_k))
    in_cells_k = np.interp(layout.grid.centres_m(2), heights_m, warmer_k)
    layers_k = np.asarray(held.flow.mean.excess_k, float).mean((0, 1)) + in_cells_k
    return layers_k if unknown_walls(prior) else layers_k.mean(keepdims=True)


def layer_means(field: Float[np.ndarray, "vx vy vz"]) -> Float[np.ndarray, " vz"]:
    """Mean of a field at each height, side walls left out."""
    return field[1:-1, 1:-1].mean((0, 1))


def sentences(
    solved: Solved, residual: Float[np.ndarray, " data"], values: Float[np.ndarray, " data"]
) -> list[str]:
    """Everything worth telling the operator."""
    parameters = solved.best.parameters
    inflow = np.asarray(solved.layout.inflow_m3_s(parameters), float)
    return [
        *solved.layout.notes,
        *undetermined(solved.problem),
        *contradictions(solved.problem, solved.prior, solved.posterior),
        *misfit(solved.data, unexplained(solved.data, residual, values)),
        *balances(parameters, inflow, solved.best.seen.outflow_excess_k, solved.problem, held_k_m3_s(solved)),
    ]


def held_k_m3_s(solved: Solved) -> float:
    """What it took to hold the temperatures that measurements say, over the whole room."""
    box = solved.problem.scene.room
    return (solved.best.flow.held_k_s or 0.0) * float(np.prod(box.size_m))


def unexplained(
    data: Observations, residual: Float[np.ndarray, " data"], values: Float[np.ndarray, " data"]
) -> float:
    """Share (rms) of the measured shifts that the room does not explain."""
    shifts = data.values()[2] == 0
    if not shifts.any():
        return _UNSEEN_SHARE
    return float(np.linalg.norm(residual[shifts]) / max(float(np.linalg.norm(values[shifts])), 1e-30))


def left_unexplained(solved: Solved, seen: Prediction) -> float:
    """Share (rms) of the measured shifts that a room leaves."""
    values, _, _ = solved.data.values()
    return unexplained(solved.data, values - solved.data.predicted(seen), values)


def free_vertices(layout: RoomLayout, shape: tuple[int, int, int]) -> Float[np.ndarray, "vx vy vz"]:
    """1 where a vertex is not on a wall of stated temperature."""
    free = np.ones(shape)
    for wall in np.flatnonzero(layout.held):
        free[tuple((-1 if wall % 2 else 0) if a == wall // 2 else slice(None) for a in AXES)] = 0.0
    return free


def carried_m2_s2(
    problem: Problem, z_m: Float[np.ndarray, " vz"], warmer_k: Float[np.ndarray, "vx vy vz"]
) -> Float[np.ndarray, " vz"]:
    """Pressure over height that carries air which is warmer by this: dp/dz = g beta dT, its mean at each height."""
    buoyancy = GRAVITY_M_S2 * problem.scene.air.expansion_per_k * warmer_k.mean((0, 1))
    return cumulative_trapezoid(buoyancy, z_m, initial=0.0)


def level_std_k(runs: list[Prediction]) -> float:
    """How far what was stated leaves the level open: a room's temperature balances what nobody knows exactly."""
    moved = [float((run.excess_k - runs[0].excess_k).mean()) for run in runs[1:]]
    return float(np.linalg.norm(moved)) / DIFFERENCE


def unknown_walls(prior: Prior) -> list[str]:
    """Walls whose temperature is fitted."""
    return [name for name, std in zip(WALLS, np.asarray(prior.std.wall_excess_k), strict=True) if std > 0]


def departure(field: Float[np.ndarray, "vx vy vz"]) -> float:
    """Rms of a field's departure from its profile of height, walls left out."""
    field = field[1:-1, 1:-1, 1:-1]
    return float(np.sqrt(np.mean((field - field.mean((0, 1))) ** 2)))


def rms(field: Float[np.ndarray, "..."]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(field))))


def _deviation(
    solved: Solved,
    name: str,
    scale: float,
    share: float,
    extra: tuple[np.ndarray | float, np.ndarray | float] = (0.0, 0.0),
) -> Deviation:
    start = getattr(solved.runs[0], name)
    moved = [(getattr(run, name) - start) / DIFFERENCE for run in solved.runs[1:]]
    between = [getattr(solved.first, name) - start, getattr(solved.other, name) - start]
    if between[1].ndim == 3:
        # Closures pass walls' heat differently; the level that follows is measured.
        between[1] = between[1] - between[1].mean((0, 1))
        if solved.data.planes:
            # The profile of height is measured by the plane; only departures from it are the grid's.
            between[0] = between[0] - between[0].mean((0, 1))
    a, c, b = _SHARES[name]
    represented = Represented(between[0], between[1], scale, (a, c * share, b * share))
    return deviation(moved, solved.posterior.covariance, represented, extra)
