"""Marches of a room as a fit needs them: settled from nothing, restarted, and moved one parameter at a time."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from core.estimate.plane_openings import air_planes, still_vertices
from core.estimate.prior import WALL_PARAMETERS, Prior
from core.known import leaving_excess_k
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters
from core.room.forward import Room, room, room_fields
from core.room.march import March, MarchSettings, march
from core.room.step import Flow
from core.room.vertices import RoomFields
from core.room.wall_planes import set_normal
from core.scene import Inlet
from core.setting import check_range, setting

Event = Callable[[dict[str, float]], object]

# Steps of the finite differences, in prior deviations: beyond the march's own wobble, short of curvature. At
# half a deviation the wobble outweighs what 1 % of a supply does, and the fit of a wrong supply does not end.
# Walls that nobody knows may be off by half the supply's excess, and jets swerve: two deviations to one side
# point where 0.25 do to 0.34-0.66 (cosine, shifts of case A), half of one to 0.77-0.94.
# Air above a suspected heater is moved by one deviation, half of the heat that marches found there.
_DIFFERENCE, _WALLS_DIFFERENCE, _SUSPECTED_DIFFERENCE = 2.0, 0.3, 1.0

# Steps a cell of the room's edge and second of the reference room, which takes half as many: a room whose
# air turns out far faster than what was stated about it must not take hours.
_STEPS = 1.5

# A jet of the reference room answers another supply within so long.
_RESPONSE_S = 30.0


@setting
class RoomSettings:
    """Grids, how long each march lasts (model seconds), and how often the images correct.

    The coarse room is corrected while a parameter moves by more than `coarse_step` prior deviations and
    the misfit falls below `worthwhile` of what it was: a coarse grid's own error must not move the rest.
    A Jacobian serves for `straight` prior deviations; where walls are unknown the fine room's is made again up
    to `again` times, once parameters moved by `straight_walls`. The fine room's rounds end with a step below
    `fine_step`; the longest march, `final_s`, follows. `wall_heat` multiplies what the balance, or the usual
    guess, gives for the walls' heat coefficient. `log_viscosity_std` is how far the eddy viscosity may vary over
    the room, in its logarithm; None for what the closure asks for (`core.estimate.prior`).
    """

    cells: int = 48
    coarse_cells: int = 32
    vertices: int = 64
    rounds: int = 8
    coarse_rounds: int = 6
    coarse_step: float = 1.0
    least_gain: float = 0.85
    jacobian_valid: float = 4.0
    jacobian_valid_walls: float = 1.5
    renewals: int = 2
    fine_step: float = 0.3
    settle_s: float = 150.0
    restart_s: float = 60.0
    refine_s: float = 60.0
    final_s: float = 90.0
    use_images: bool = True
    log_viscosity_std: float | None = None
    wall_heat: float = 1.0
    threads: int = 2

    def __post_init__(self) -> None:
        check_range("wall_heat", self.wall_heat, 0.01, 100.0, "", "1 takes what the heat balance gives.")


class ForwardRun(eqx.Module):
    """One march of a room: its parameters, how it went, and what measurements would see."""

    parameters: RoomParameters
    flow: March
    fields: RoomFields


class Derivatives(eqx.Module):
    """A room as it is, and with one parameter after the other moved by `steps` prior deviations."""

    start: RoomFields
    moved: list[RoomFields]
    steps: Float[np.ndarray, " active"]

    def per_deviation(self, read: Callable[[RoomFields], ArrayLike]) -> Float[np.ndarray, "active ..."]:
        """Change of what `read` takes from a room, per prior deviation of each parameter."""
        before = np.asarray(read(self.start))
        changes = [
            (np.asarray(read(run)) - before) / step for run, step in zip(self.moved, self.steps, strict=True)
        ]
        return np.stack(changes) if changes else np.zeros((0, *before.shape))


def run_as_stated(
    coarse: Room,
    prior: Prior,
    problem: Problem,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    report: Event,
) -> ForwardRun:
    """The coarse room as stated, marched from a measured profile or the leaving air's temperature."""
    model = coarse.model(prior.mean)
    flow = coarse.at_rest(model, first_profile_k(problem, coarse))
    return march_under(coarse, prior.mean, flow, settings.settle_s, vertices, report)


def first_profile_k(problem: Problem, coarse: Room) -> Float[np.ndarray, " nz"]:
    """Excess temperature of each layer to start from: a plane's, else what leaves, else half the supply's."""
    heights = coarse.grid.centres_m(2)
    ambient = problem.scene.air.ambient_temperature_k
    for plane in air_planes(problem):
        still = still_vertices(plane)
        count = np.maximum(still.sum(0), 1)
        profile = np.where(still, plane.temperature_k - ambient, 0.0).sum(0) / count
        return np.interp(heights, plane.second_m[still.any(0)], profile[still.any(0)])
    leaving = leaving_excess_k(problem)
    if leaving is None:
        inlets = [b for b in problem.scene.boundary if isinstance(b, Inlet)]
        leaving = 0.5 * float(np.mean([i.temperature_k - ambient for i in inlets])) if inlets else 0.0
    return np.full(len(heights), leaving)


def march_under(
    where: Room,
    parameters: RoomParameters,
    flow: Flow,
    seconds: float,
    vertices: tuple[int, int, int],
    report: Event,
    *,
    held_k: Float[np.ndarray, " layers"] | None = None,
) -> ForwardRun:
    """March `flow` under these parameters and look at its mean; seconds are those of the reference room.

    Layers, or the room, are kept at the mean excess temperatures `held_k` where those are given.
    """
    model = where.model(parameters)
    flow = eqx.tree_at(lambda f: f.velocity, flow, set_normal(flow.velocity, model.boundary))
    turnover_ratio = where.turnover_ratio
    timing = MarchSettings(
        longest_s=seconds * turnover_ratio,
        least_s=min(seconds, _RESPONSE_S) * turnover_ratio,
        window_s=min(5.0, seconds) * turnover_ratio,
        settle_s=0.15 * seconds * turnover_ratio,
        level_ahead_s=20.0 * turnover_ratio,
        most_steps=round(_STEPS * float(np.prod(where.grid.cells)) ** (1 / 3) * seconds),
    )
    held = None if held_k is None else jnp.asarray(held_k, jnp.float32)
    done = march(flow, model, timing, held_k=held, on_window=report)
    return ForwardRun(parameters, done, room_fields(done.mean, model, where.layout, vertices))


def perturbed(
    where: Room,
    prior: Prior,
    vector: Float[np.ndarray, " active"],
    base: ForwardRun,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
) -> Derivatives:
    """The settled room again, first as it is and then with one parameter moved after the other."""
    sizes = differences(prior)

    def one(step: Float[np.ndarray, " active"]) -> RoomFields:
        quiet: Event = lambda _: None  # noqa: E731
        return march_under(
            where, prior.parameters(vector + step), base.flow.last, settings.restart_s, vertices, quiet
        ).fields

    with ThreadPoolExecutor(settings.threads) as pool:
        start, *moved = pool.map(one, [np.zeros(len(sizes)), *np.diag(sizes)])
    return Derivatives(start, moved, sizes)


def differences(prior: Prior) -> Float[np.ndarray, " active"]:
    """By how many prior deviations each parameter is moved to see what it does."""
    walls = [bool(prior.unknown_walls()) and name.startswith(WALL_PARAMETERS) for name in prior.names()]
    sizes = np.where(walls, _WALLS_DIFFERENCE, _DIFFERENCE)
    return np.where(prior.suspected(), _SUSPECTED_DIFFERENCE, sizes)


def other_closure(where: Room) -> str:
    """The closure that a room is held against."""
    return "constant" if where.closure == "zero_equation" else "zero_equation"


def run_under_other_closure(
    where: Room,
    parameters: RoomParameters,
    base: ForwardRun,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
) -> RoomFields:
    """The settled room again under another closure: what turbulence modelling leaves open."""
    last = base.flow.last
    flow = Flow(last.velocity, last.excess_k, last.pressure_m2_s2, None)
    another = room(where.scene, settings.coarse_cells, other_closure(where))
    return march_under(another, parameters, flow, settings.restart_s, vertices, lambda _: None).fields
