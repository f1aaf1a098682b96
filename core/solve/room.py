"""Solve by a room that is marched in time and whose boundary the images correct.

A coarse room settles, a finer one starts from it, and the misfit with the data corrects what was stated
(`core.estimate.parameter_fit`). What comes out carries standard deviations: the parameters' posterior, and what the
grid and the closure cannot represent, from the differences of two grids and of two closures.
"""

import time

import numpy as np

from core.estimate.alternatives import HEAT_WORTHWHILE, left_over, promising_closure, suspected_heat
from core.estimate.diagnostics import another_closure
from core.estimate.forward_runs import (
    Attempt,
    Derivatives,
    Event,
    RoomSettings,
    attempt,
    otherwise_closed,
    perturbed,
    settled,
)
from core.estimate.levenberg_marquardt import fine_search
from core.estimate.observation import Observations, observations
from core.estimate.parameter_fit import Begun, coarse_fit, fine_fit, held_fit
from core.estimate.parameter_step import Vector
from core.estimate.plane_openings import with_plane_openings
from core.estimate.posterior import Solved, solution
from core.estimate.prior import room_prior
from core.problem import Problem
from core.result import Solution
from core.room.boundary_conditions import RoomLayout
from core.room.forward import carried_over, closure_name, room


def solve_room(
    problem: Problem, settings: RoomSettings = RoomSettings(), *, on_event: Event | None = None
) -> Solution:
    """T, p and u of the room, with deviations and sentences about what the images contradict.

    Raises:
        SettingError: a boundary that cannot be (see `core.room.boundary_conditions`).
    """
    start_s = time.perf_counter()
    tell: Event = on_event or (lambda _: None)
    return finish(begin(problem, settings, tell), problem, settings, tell, start_s=start_s)


def begin(problem: Problem, settings: RoomSettings, tell: Event, closure: str | None = None) -> Begun:
    """What is the same for all images of a room: both grids as stated, and the coarse one's derivatives.

    `closure` is another than the scene's.
    """
    problem = with_plane_openings(problem)
    closure = closure or closure_name(problem.scene)
    coarse, fine = (room(problem.scene, n, closure) for n in (settings.coarse_cells, settings.cells))
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    prior = room_prior(
        problem, coarse.layout, log_viscosity_std=settings.log_viscosity_std, wall_heat=settings.wall_heat
    )
    base = settled(coarse, prior, problem, settings, vertices, tell)
    flow = carried_over(base.flow.last, coarse.grid, fine.grid)
    first = attempt(fine, prior.mean, flow, settings.refine_s, vertices, tell)
    derivatives = perturbed(coarse, prior, np.zeros(len(prior.active())), base, settings, vertices)
    # As it looks after having settled for as long again.
    base = Attempt(base.parameters, base.flow, derivatives.start)
    return Begun(problem, coarse, fine, prior, base, first, derivatives)


def finish(
    begun: Begun, problem: Problem, settings: RoomSettings, tell: Event, *, start_s: float
) -> Solution:
    """The solution for the shifts of `problem`, another measurement of the room that was begun.

    Where heat that nobody stated, or another closure, may explain the images better, a room with it is fitted as well
    and the better of the two is taken.
    """
    solved = fitted_room(begun, problem, settings, tell)
    notes: tuple[str, ...] = ()
    name = promising_closure(solved, begun.coarse) if settings.use_images else None
    if name is not None:
        again = fitted_room(begin(begun.problem, settings, tell, name), problem, settings, tell)
        if left_over(again) < left_over(solved):
            notes = (another_closure(name, left_over(again), begun.coarse.closure, left_over(solved)),)
            solved = again
    warm = suspected_heat(solved, begun, settings, tell)
    if warm is not None:
        again = fitted_room(begin(warm, settings, tell, begun.coarse.closure), problem, settings, tell)
        if left_over(again) < HEAT_WORTHWHILE * left_over(solved):
            notes, solved = (), again
    tell(supplied(solved.layout, solved.best))
    return solution(solved, time.perf_counter() - start_s, use_images=settings.use_images, notes=notes)


def data_of(begun: Begun, problem: Problem, settings: RoomSettings) -> Observations:
    """The data of `problem`, as vertices of the room that was begun see them."""
    stated = begun.problem
    of = Problem(stated.scene, problem.shifts, stated.planes, stated.sensors)
    return observations(of, (settings.vertices, settings.vertices, settings.vertices))


def fitted_room(begun: Begun, problem: Problem, settings: RoomSettings, tell: Event) -> Solved:
    """Parameters and level that measurements ask for, and what deviations are made of."""
    coarse, fine, prior = begun.coarse, begun.fine, begun.prior
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    data = data_of(begun, problem, settings)
    vector, base, linearised = coarse_fit(begun, data, settings, tell)
    other = otherwise_closed(coarse, prior.parameters(vector), base, settings, vertices)
    first = begun.first
    seconds = settings.refine_s + (0.0 if settings.use_images else settings.final_s)
    if np.any(vector) or not settings.use_images:
        first = attempt(fine, prior.parameters(vector), first.flow.last, seconds, vertices, tell)

    def made_again(where: Vector) -> Derivatives:
        return perturbed(coarse, prior, where, base, settings, vertices)

    derivatives = linearised
    if settings.use_images and prior.unknown_walls():
        found, derivatives = fine_search(fine, prior, data, first, linearised, made_again, settings, tell)
    else:
        found = fine_fit(fine, prior, data, vector, first, linearised, settings, tell)
    before = best = found.room
    if settings.use_images:
        best = held_fit(fine, prior, data, before, derivatives, settings, tell)
    return Solved(
        begun.problem,
        data,
        prior,
        found.posterior,
        derivatives,
        coarse=linearised.start,
        first=first.seen,
        other=other,
        before=before,
        best=best,
        layout=fine.layout,
    )


def supplied(layout: RoomLayout, best: Attempt) -> dict[str, float]:
    """Excess temperature and speed of every supply in the room that was found."""
    found: dict[str, float] = {}
    for n, velocity in enumerate(layout.inlet_velocity_m_s):
        speed = float(np.linalg.norm(velocity)) * float(np.exp(best.parameters.inlet_log_flow[n]))
        found |= {
            f"supply_{n + 1}_excess_k": float(best.parameters.inlet_excess_k[n]),
            f"supply_{n + 1}_m_s": speed,
        }
    return found
