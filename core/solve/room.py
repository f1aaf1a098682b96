"""Solve by a room that is marched in time and whose boundary the images correct.

A coarse room settles, then one restart a parameter says what each would change (the Jacobian). A finer
room starts from the coarse one; its misfit with the data moves the parameters by Gauss-Newton, and it
marches on. What comes out carries standard deviations: the parameters' posterior, and what the grid
cannot represent, from the difference of the two grids.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.problem import Problem
from core.result import Solution
from core.room.boundary import set_normal
from core.room.fit import Posterior, gauss_newton, weighted_variance
from core.room.grid import AXES
from core.room.march import March, MarchSettings, march
from core.room.model import Flow
from core.room.observe import Observations, Prediction, observations
from core.room.plane_openings import with_plane_openings
from core.room.prior import Prior, outflow_excess_k, room_prior
from core.room.residue import temperature_correction
from core.room.room import Room, carried_over, room, seen
from core.room.sentences import balances, contradictions, misfit, undetermined
from core.room.setup import RoomLayout, RoomParameters
from core.scene import Inlet, Scene
from core.setting import setting
from core.uncertainty import Deviation, deviation

Event = Callable[[dict[str, float]], object]

# Steps of the finite differences, in prior deviations: beyond the march's own wobble, short of curvature.
_DIFFERENCE = 0.5
# Prior size of the temperature's last correction, as a share of the departure from the profile.
CORRECTION_SHARE = 0.3
PRESSURE_SCALE = 1.6


@setting
class RoomSettings:
    """Grids, how long each march lasts (model seconds), and how often the images correct.

    The coarse room is corrected while a parameter moves by more than `coarse_step` prior deviations.
    """

    cells: int = 48
    coarse_cells: int = 32
    vertices: int = 64
    rounds: int = 3
    coarse_rounds: int = 4
    coarse_step: float = 1.0
    settle_s: float = 150.0
    restart_s: float = 60.0
    refine_s: float = 45.0
    final_s: float = 60.0
    use_images: bool = True
    log_viscosity_std: float = 0.0
    threads: int = 2


class Attempt(eqx.Module):
    """One march of a room: its parameters, how it went, and what measurements would see."""

    parameters: RoomParameters
    flow: March
    seen: Prediction


def solve_room(
    problem: Problem, settings: RoomSettings = RoomSettings(), *, on_event: Event | None = None
) -> Solution:
    """T, p and u of the room, with deviations and sentences about what the images contradict.

    Raises:
        SettingError: a boundary that cannot be (see `core.room.setup`).
    """
    start_s = time.perf_counter()
    tell: Event = on_event or (lambda _: None)
    problem = with_plane_openings(problem)
    scene = problem.scene
    closure = closure_name(scene)
    coarse, fine = (room(scene, n, closure) for n in (settings.coarse_cells, settings.cells))
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    data = observations(problem, vertices)
    prior = room_prior(problem, coarse.layout, log_viscosity_std=settings.log_viscosity_std)
    vector = np.zeros(len(prior.active()))
    base = settled(coarse, prior, problem, settings, vertices, tell)
    jacobian = perturbed(coarse, prior, vector, base, settings, vertices)
    moved = False
    for n in range(settings.coarse_rounds if settings.use_images else 0):
        # No second grid yet: half of the misfit is taken for the grid's.
        half = 0.5 * (data.values()[0] - data.predicted(base.seen))
        new = corrected(vector, base, data, jacobian, half, trusting=True).vector
        step = float(np.abs(new - vector).max(initial=0.0))
        if step < settings.coarse_step:
            break
        vector, moved = new, True
        base = attempt(coarse, prior.parameters(vector), base.flow.last, settings.restart_s, vertices, tell)
        tell({"coarse_round": n + 1.0, "moved": step, **fitted(prior, vector)})
    if moved:
        jacobian = perturbed(coarse, prior, vector, base, settings, vertices)
    flow = carried_over(base.flow.last, coarse.grid, fine.grid)
    best = first = attempt(fine, prior.parameters(vector), flow, settings.refine_s, vertices, tell)
    grid_difference = data.predicted(best.seen) - data.predicted(jacobian[0])
    posterior: Posterior | None = None
    for n in range(settings.rounds if settings.use_images else 0):
        posterior = corrected(vector, best, data, jacobian, grid_difference)
        vector = posterior.vector
        seconds = settings.final_s if n == settings.rounds - 1 else settings.refine_s
        best = attempt(fine, prior.parameters(vector), best.flow.last, seconds, vertices, tell)
        tell({"round": n + 1.0, **fitted(prior, vector)})
    posterior = posterior or Posterior(vector, np.eye(len(vector)), np.zeros(0))
    solved = Solved(problem, data, prior, posterior, jacobian, first.seen, best, fine.layout)
    return solution(solved, time.perf_counter() - start_s, use_images=settings.use_images)


def closure_name(scene: Scene) -> str:
    """The closure that a scene asks for; `auto` and `learned` start from k-epsilon."""
    named = {"molecular": "molecular", "given": "constant", "zero_equation": "zero_equation"}
    return named.get(scene.flow.transport, "k_epsilon")


def settled(
    coarse: Room,
    prior: Prior,
    problem: Problem,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    tell: Event,
) -> Attempt:
    """The coarse room as stated, marched from a measured profile or the leaving air's temperature."""
    model = coarse.model(prior.mean)
    flow = coarse.at_rest(model, first_profile_k(problem, coarse))
    return attempt(coarse, prior.mean, flow, settings.settle_s, vertices, tell)


def first_profile_k(problem: Problem, coarse: Room) -> Float[np.ndarray, " nz"]:
    """Excess temperature of each layer to start from: a plane's, else what leaves, else half the supply's."""
    heights = coarse.grid.centres_m(2)
    ambient = problem.scene.air.ambient_temperature_k
    for plane in problem.planes:
        if plane.wall[0] != "z":
            still = np.abs(plane.velocity_m_s).max(axis=2) < 0.02 * np.abs(plane.velocity_m_s).max()
            still[[0, -1]] = False
            count = np.maximum(still.sum(0), 1)
            profile = np.where(still, plane.temperature_k - ambient, 0.0).sum(0) / count
            return np.interp(heights, plane.second_m[still.any(0)], profile[still.any(0)])
    leaving = outflow_excess_k(problem)
    if leaving is None:
        inlets = [b for b in problem.scene.boundary if isinstance(b, Inlet)]
        leaving = 0.5 * float(np.mean([i.temperature_k - ambient for i in inlets])) if inlets else 0.0
    return np.full(len(heights), leaving)


def attempt(
    where: Room,
    parameters: RoomParameters,
    flow: Flow,
    seconds: float,
    vertices: tuple[int, int, int],
    tell: Event,
) -> Attempt:
    """March `flow` under these parameters and look at its mean; seconds are those of the reference room."""
    model = where.model(parameters)
    flow = eqx.tree_at(lambda f: f.velocity, flow, set_normal(flow.velocity, model.boundary))
    pace = where.pace
    timing = MarchSettings(
        longest_s=seconds * pace,
        window_s=min(5.0, seconds) * pace,
        settle_s=0.15 * seconds * pace,
        level_ahead_s=20.0 * pace,
    )
    done = march(flow, model, timing, on_window=tell)
    return Attempt(parameters, done, seen(done.mean, model, vertices))


def perturbed(
    where: Room,
    prior: Prior,
    vector: Float[np.ndarray, " active"],
    base: Attempt,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
) -> list[Prediction]:
    """The settled room again, first as it is and then with one parameter moved after the other."""
    steps = [np.zeros(len(prior.active())), *(np.eye(len(prior.active())) * _DIFFERENCE)]

    def one(step: Float[np.ndarray, " active"]) -> Prediction:
        quiet: Event = lambda _: None  # noqa: E731
        return attempt(
            where, prior.parameters(vector + step), base.flow.last, settings.restart_s, vertices, quiet
        ).seen

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(one, steps))


def corrected(
    vector: Float[np.ndarray, " active"],
    best: Attempt,
    data: Observations,
    runs: list[Prediction],
    grid_difference: Float[np.ndarray, " data"],
    *,
    trusting: bool = False,
) -> Posterior:
    """One Gauss-Newton step from `vector` by the misfit of `best`."""
    values, variance, group = data.values()
    start = data.predicted(runs[0])
    jacobian = np.stack([(data.predicted(run) - start) / _DIFFERENCE for run in runs[1:]], axis=1)
    residual = values - data.predicted(best.seen)
    weights = weighted_variance(variance, group, residual, grid_difference)
    return gauss_newton(vector, residual, weights, jacobian, trusting=trusting)


def fitted(prior: Prior, vector: Float[np.ndarray, " active"]) -> dict[str, float]:
    """Parameters by name, in deviations from their priors."""
    return dict(zip(prior.names(), (float(v) for v in vector), strict=True))


class Solved(eqx.Module):
    """Everything that a solve leaves behind: what a solution and its deviations are made of."""

    problem: Problem
    data: Observations
    prior: Prior
    posterior: Posterior
    runs: list[Prediction]
    first: Prediction
    best: Attempt
    layout: RoomLayout


def solution(solved: Solved, seconds: float, *, use_images: bool) -> Solution:
    """The room as a result, with the temperature's last correction, deviations and sentences."""
    best, box, problem = solved.best, solved.problem.scene.room, solved.problem
    values, _, _ = solved.data.values()
    residual = values - solved.data.predicted(best.seen)
    # Pressure follows the level of T, which no departure shows.
    scales = [
        departure(best.seen.excess_k),
        PRESSURE_SCALE * rms(best.seen.pressure_m2_s2),
        rms(best.seen.velocity_m_s),
    ]
    change = temperature_correction(solved.data, best.seen.excess_k, residual, CORRECTION_SHARE * scales[0])
    free = free_vertices(solved.layout, best.seen.excess_k.shape)
    excess = best.seen.excess_k + (change.excess_k[:, None, :] * free if use_images else 0.0)
    variances = (change.prior_variance_k2[:, None, :] * free, change.variance_k2[:, None, :] * free)
    temperature = _deviation(solved, "excess_k", scales[0], variances)
    pressure = _deviation(solved, "pressure_m2_s2", scales[1], (0.0, 0.0))
    velocity = _deviation(solved, "velocity_m_s", scales[2], (0.0, 0.0))
    x, y, z = (np.linspace(box.lower_m[a], box.upper_m[a], n) for a, n in enumerate(excess.shape))
    return Solution(
        x,
        y,
        z,
        problem.scene.air.ambient_temperature_k + excess,
        best.seen.pressure_m2_s2,
        best.seen.velocity_m_s,
        temperature.std,
        pressure.std,
        velocity.std,
        temperature.informed,
        outcome=best.flow.outcome,
        solver_s=seconds,
        notes=tuple(sentences(solved, residual, values)),
    )


def sentences(
    solved: Solved, residual: Float[np.ndarray, " data"], values: Float[np.ndarray, " data"]
) -> list[str]:
    """Everything worth telling the operator."""
    parameters = solved.best.parameters
    inflow = float(np.sum(np.asarray(solved.layout.inflow_m3_s(parameters))))
    return [
        *solved.layout.notes,
        *undetermined(solved.problem),
        *contradictions(solved.problem, solved.prior, solved.posterior),
        *misfit(solved.data, residual, values),
        *balances(parameters, inflow, solved.best.seen.outflow_excess_k, solved.problem),
    ]


def free_vertices(layout: RoomLayout, shape: tuple[int, int, int]) -> Float[np.ndarray, "vx vy vz"]:
    """1 where a vertex is not on a wall of stated temperature."""
    free = np.ones(shape)
    for wall in np.flatnonzero(layout.held):
        free[tuple((-1 if wall % 2 else 0) if a == wall // 2 else slice(None) for a in AXES)] = 0.0
    return free


def departure(field: Float[np.ndarray, "vx vy vz"]) -> float:
    """Rms of a field's departure from its profile of height, walls left out."""
    field = field[1:-1, 1:-1, 1:-1]
    return float(np.sqrt(np.mean((field - field.mean((0, 1))) ** 2)))


def rms(field: Float[np.ndarray, "..."]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(field))))


def _deviation(
    solved: Solved, name: str, scale: float, extra: tuple[np.ndarray | float, np.ndarray | float]
) -> Deviation:
    start = getattr(solved.runs[0], name)
    moved = [(getattr(run, name) - start) / _DIFFERENCE for run in solved.runs[1:]]
    between = getattr(solved.first, name) - start
    if solved.data.planes and between.ndim == 3:
        # The profile of height is measured by the plane; only departures from it are the grid's.
        between = between - between.mean((0, 1))
    return deviation(moved, solved.posterior.covariance, between, scale, extra)
