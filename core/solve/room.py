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
from core.room.prior import Prior, outflow_excess_k, room_prior
from core.room.room import Room, carried_over, room, seen
from core.room.setup import RoomParameters
from core.scene import Inlet, Scene
from core.setting import setting

Event = Callable[[dict[str, float]], None]

# Steps of the finite differences, in prior deviations: beyond the march's own wobble, short of curvature.
_DIFFERENCE = 0.5


@setting
class RoomSettings:
    """Grids, how long each march lasts (model seconds), how often the images correct, and the closure."""

    cells: int = 48
    coarse_cells: int = 32
    vertices: int = 64
    rounds: int = 2
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
    tell = on_event or (lambda _: None)
    scene = problem.scene
    closure = closure_name(scene)
    coarse, fine = (room(scene, n, closure) for n in (settings.coarse_cells, settings.cells))
    vertices = (settings.vertices,) * 3
    data = observations(problem, vertices)
    prior = room_prior(problem, coarse.layout, log_viscosity_std=settings.log_viscosity_std)
    vector = np.zeros(len(prior.active()))
    base = settled(coarse, prior, problem, settings, vertices, tell)
    jacobian = perturbed(coarse, prior, base, settings, vertices)
    flow = carried_over(base.flow.last, coarse.grid, fine.grid)
    best = attempt(fine, prior.parameters(vector), flow, settings.refine_s, vertices, tell)
    grid_difference = data.predicted(best.seen) - data.predicted(jacobian[0])
    posterior = None
    for n in range(settings.rounds if settings.use_images else 0):
        posterior = corrected(vector, best, data, jacobian, grid_difference)
        vector = posterior.vector
        seconds = settings.final_s if n == settings.rounds - 1 else settings.refine_s
        best = attempt(fine, prior.parameters(vector), best.flow.last, seconds, vertices, tell)
        tell({"round": n + 1.0, **fitted(prior, vector)})
    return solution(problem, best, posterior, prior, time.perf_counter() - start_s)


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
    """Excess temperature of each layer to start from: a plane's, else what leaves, else half of what comes."""
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
    """March `flow` under these parameters and look at its mean."""
    model = where.model(parameters)
    flow = eqx.tree_at(lambda f: f.velocity, flow, set_normal(flow.velocity, model.boundary))
    done = march(flow, model, MarchSettings(longest_s=seconds, settle_s=0.15 * seconds), on_window=tell)
    return Attempt(parameters, done, seen(done.mean, model, vertices))


def perturbed(
    where: Room, prior: Prior, base: Attempt, settings: RoomSettings, vertices: tuple[int, int, int]
) -> list[Prediction]:
    """The settled room again, first as it is and then with one parameter moved after the other."""
    steps = [np.zeros(len(prior.active())), *(np.eye(len(prior.active())) * _DIFFERENCE)]

    def one(step: Float[np.ndarray, " active"]) -> Prediction:
        quiet: Event = lambda _: None  # noqa: E731
        return attempt(
            where, prior.parameters(step), base.flow.last, settings.restart_s, vertices, quiet
        ).seen

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(one, steps))


def corrected(
    vector: Float[np.ndarray, " active"],
    best: Attempt,
    data: Observations,
    runs: list[Prediction],
    grid_difference: Float[np.ndarray, " data"],
) -> Posterior:
    """One Gauss-Newton step from `vector` by the misfit of `best`."""
    values, variance, group = data.values()
    start = data.predicted(runs[0])
    jacobian = np.stack([(data.predicted(run) - start) / _DIFFERENCE for run in runs[1:]], axis=1)
    residual = values - data.predicted(best.seen)
    return gauss_newton(vector, residual, weighted_variance(variance, group, residual, grid_difference), jacobian)


def fitted(prior: Prior, vector: Float[np.ndarray, " active"]) -> dict[str, float]:
    """Parameters by name, in deviations from their priors."""
    return dict(zip(prior.names(), (float(v) for v in vector), strict=True))


def solution(
    problem: Problem, best: Attempt, posterior: Posterior | None, prior: Prior, seconds: float
) -> Solution:
    """The room as a result."""
    n = best.seen.excess_k.shape
    x, y, z = (np.linspace(problem.scene.room.lower_m[a], problem.scene.room.upper_m[a], n[a]) for a in AXES)
    return Solution(
        x,
        y,
        z,
        problem.scene.air.ambient_temperature_k + best.seen.excess_k,
        best.seen.pressure_m2_s2,
        best.seen.velocity_m_s,
        outcome=best.flow.outcome,
        solver_s=seconds,
    )
