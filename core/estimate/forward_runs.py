"""Forward runs: marches of a room from rest, restarts with other parameters, and finite differences."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import ArrayLike, Float

from core.estimate.marches import Marches, work
from core.estimate.plane_openings import profiles, still_vertices
from core.estimate.prior import Prior
from core.known import leaving_excess_k
from core.problem import Problem
from core.result import Outcome, Solution
from core.room.boundary_conditions import RoomParameters
from core.room.closure import KEpsilonClosure
from core.room.forward import LARGE_EDDIES, Room, room, room_fields
from core.room.march import March, MarchSettings, MarchState
from core.room.step import Flow, RoomModel
from core.room.vertices import RoomFields
from core.room.wall_planes import set_normal
from core.scene import Inlet
from core.setting import check_range, setting

# Most time steps of a march, for each cell along the room's edge and each second. The reference room takes a quarter
# of them; the limit stops a march whose air is far faster than what was stated.
_STEPS = 0.6

# Large eddies are marched so many times as long, in true time, which has up to four times as many steps. Supplies are
# disturbed anew every sixteen steps. What warms during a window is chance, so no level is extrapolated from it.
EDDIES_LONGER, _TRUE_TIME = 2.0, 4
_EDDIES = {"steady": False, "tolerance": 0.0, "settled": 1.0, "level_ahead_s": 0.0, "chunk_steps": 8}

# A jet in the reference room responds to a change of its supply within this time.
_RESPONSE_S = 60.0


@setting
class RoomSettings:
    """Grids, lengths of the marches, and when the fit stops. Steps are in prior standard deviations.

    Times are those of the reference room, as its cells live them in the mean (`core.room.march`); slower rooms march
    longer (`Room.turnover_ratio`).

    `jacobian_valid`, `renewals`: a Jacobian is computed anew once a parameter has moved this far from where it was
    computed, and so often at most.
    `restart_walls_s`: as `restart_s`, where walls are unknown: jets answer slowly to a wall.
    `fine_step`: rounds end when no parameter moves by more.
    `wall_heat`: multiplies the walls' heat coefficient from the heat balance, or the nominal one.
    """

    cells: int = 48
    coarse_cells: int = 32
    vertices: int = 64
    rounds: int = 8
    jacobian_valid: float = 1.5
    renewals: int = 2
    fine_step: float = 0.3
    settle_s: float = 240.0
    restart_s: float = 90.0
    restart_walls_s: float = 180.0
    refine_s: float = 90.0
    use_images: bool = True
    wall_heat: float = 1.0
    threads: int = 2

    def restarts_s(self, prior: Prior) -> float:
        """How long a coarse room marches on under other parameters."""
        return self.restart_walls_s if prior.unknown_walls() else self.restart_s

    def __post_init__(self) -> None:
        check_range("wall_heat", self.wall_heat, 0.01, 100.0, "", "1 takes what the heat balance gives.")


class ForwardRun(eqx.Module):
    """One march of a room: its parameters, its course, and its mean fields on vertices."""

    parameters: RoomParameters
    flow: March
    fields: RoomFields


class Derivatives(eqx.Module):
    """Fields of one room, and of others whose parameters lie `apart` from its own, in prior deviations."""

    start: RoomFields
    others: list[RoomFields]
    apart: Float[np.ndarray, "others active"]

    def per_deviation(self, read: Callable[[RoomFields], ArrayLike]) -> Float[np.ndarray, "active ..."]:
        """Derivative of `read(fields)` in each parameter, per prior deviation: least squares over the others."""
        before = np.asarray(read(self.start), float)
        if not self.others:
            return np.zeros((0, *before.shape))
        changes = np.stack([np.asarray(read(run), float) - before for run in self.others])
        return np.tensordot(np.linalg.pinv(self.apart), changes, axes=1)


def run_as_stated(
    coarse: Room,
    prior: Prior,
    problem: Problem,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    marches: Marches,
) -> ForwardRun:
    """The coarse room under the prior's mean, marched from still air."""
    model = coarse.model(prior.mean)
    flow = coarse.at_rest(model, first_profile_k(problem, coarse))
    doing = "march the coarse room as stated"
    return march_under(coarse, prior.mean, flow, settings.settle_s, vertices, marches, doing=doing)


def first_profile_k(problem: Problem, coarse: Room) -> Float[np.ndarray, " nz"]:
    """Excess temperature of still air over height: a plane's profile, else the outflow's, else half the supply's."""
    heights = coarse.grid.centres_m(2)
    ambient = problem.scene.air.ambient_temperature_k
    for plane in profiles(problem):
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
    marches: Marches,
    *,
    doing: str | None = None,
    mean_windows: int | None = None,
) -> ForwardRun:
    """March `flow` under these parameters; `seconds` are those of the reference room.

    The result is the mean over the last `mean_windows`, or over as many as the room's unrest asks for.
    What the march is for, `doing`, is told with every window; without it nothing is.
    """
    model = where.model(parameters)
    flow = eqx.tree_at(lambda f: f.velocity, flow, set_normal(flow.velocity, model.boundary))
    if not isinstance(model.closure, KEpsilonClosure):
        # The march may begin in a room of k-epsilon, whose turbulence no other closure has.
        flow = Flow(flow.velocity, flow.excess_k, flow.pressure_m2_s2, None)
    if where.closure == LARGE_EDDIES:
        seconds = EDDIES_LONGER * seconds
    timing = replace(_timing(where, seconds), mean_windows=mean_windows)
    counted = work(where.grid, seconds)

    def passed(state: MarchState) -> None:
        if doing is not None:
            row = {"doing": doing, "model_s": state.model_s, "change": state.change}
            under_way = counted * min(1.0, state.model_s / timing.longest_s)
            # A first window that is not finite has no mean.
            growing = (lambda: _growing(where, state, model, vertices)) if state.means else None
            marches.tell(row, growing, under_way=under_way)

    done = marches.run(flow, model, timing, counted=counted, on_window=passed)
    if doing is not None:
        marches.record({"doing": doing, "model_s": done.model_s, "change": done.change})
    return ForwardRun(parameters, done, room_fields(done.mean, model, where.layout, vertices))


def _timing(where: Room, seconds: float) -> MarchSettings:
    """How to march so long; `seconds` are those of the reference room."""
    turnover_ratio = where.turnover_ratio
    steady = MarchSettings(
        longest_s=seconds * turnover_ratio,
        least_s=min(seconds, _RESPONSE_S) * turnover_ratio,
        window_s=min(15.0, seconds) * turnover_ratio,
        settle_s=0.15 * seconds * turnover_ratio,
        level_ahead_s=20.0 * turnover_ratio,
        most_steps=round(_STEPS * float(np.prod(where.grid.cells)) ** (1 / 3) * seconds),
    )
    if where.closure != LARGE_EDDIES:
        return steady
    return replace(steady, **_EDDIES, most_steps=_TRUE_TIME * steady.most_steps)


def _growing(where: Room, state: MarchState, model: RoomModel, vertices: tuple[int, int, int]) -> Solution:
    """The last window's mean as a result."""
    found, box = room_fields(state.means[-1], model, where.layout, vertices), where.scene.room
    x, y, z = (np.linspace(box.lower_m[a], box.upper_m[a], n) for a, n in enumerate(vertices))
    kelvin = where.scene.air.ambient_temperature_k + found.excess_k
    return Solution(x, y, z, kelvin, found.pressure_m2_s2, found.velocity_m_s, outcome=Outcome.step_limit)


def perturbed(
    where: Room,
    prior: Prior,
    vector: Float[np.ndarray, " active"],
    spread: Float[np.ndarray, " active"],
    base: ForwardRun,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    marches: Marches,
) -> tuple[Derivatives, ForwardRun]:
    """Restarts of the run `base` under the parameters `vector`: one for each that is moved, and one as they are.

    Each parameter is moved by as far as it is uncertain, `spread` (in prior deviations): a derivative must hold over
    that range, and a room's response is no straight line. What is not yet steady is so in all of them alike, and all
    are means over the same windows. Returns the derivatives and the run that none was moved in, where the next
    restarts begin.
    """
    flow, seconds = base.flow.last, settings.restarts_s(prior)

    def one(step: Float[np.ndarray, " active"], mean_windows: int | None = None) -> ForwardRun:
        parameters = prior.parameters(vector + step)
        return march_under(where, parameters, flow, seconds, vertices, marches, mean_windows=mean_windows)

    def moved(step: Float[np.ndarray, " active"]) -> RoomFields:
        return one(step, unmoved.flow.mean_windows).fields

    def told(count: int) -> None:
        doing = "move one parameter after the other"
        marches.record({"doing": doing, "moved": float(count), "of": float(len(spread))})

    unmoved = one(np.zeros(len(spread)))
    told(0)
    others: list[RoomFields] = []
    with ThreadPoolExecutor(settings.threads) as pool:
        for fields in pool.map(moved, np.diag(spread)):
            others.append(fields)
            told(len(others))
    return Derivatives(unmoved.fields, others, np.diag(spread)), unmoved


def other_closure(where: Room) -> str:
    """The closure that a room is compared with."""
    return "constant" if where.closure == "zero_equation" else "zero_equation"


def run_under_other_closure(
    where: Room,
    prior: Prior,
    vector: Float[np.ndarray, " active"],
    base: ForwardRun,
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    marches: Marches,
) -> RoomFields:
    """A restart of the run `base` under another closure: the difference is an error of turbulence modelling."""
    another = room(where.scene, settings.coarse_cells, other_closure(where))
    doing = f"march the coarse room by the closure {another.closure}"
    parameters, seconds = prior.parameters(vector), settings.restarts_s(prior)
    return march_under(another, parameters, base.flow.last, seconds, vertices, marches, doing=doing).fields
