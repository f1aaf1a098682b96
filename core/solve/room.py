"""`standard` and `reference`: a room marched in time, with its boundary corrected by the measurements.

A coarse room is marched to a steady state, a finer one starts from it, and the fit (`core.estimate`) corrects what
was stated. Standard deviations come from the parameters' posterior and from the differences of two grids and of two
closures. core/estimate/README.md has the method.
"""

import time

import numpy as np

from core.estimate.alternatives import KEEP_HEAT, left_over, promising_closure, suspected_heat
from core.estimate.diagnostics import another_closure
from core.estimate.forward_runs import (
    Derivatives,
    Event,
    ForwardRun,
    RoomSettings,
    march_under,
    perturbed,
    run_as_stated,
    run_under_other_closure,
)
from core.estimate.levenberg_marquardt import fine_search
from core.estimate.observation import Observations, observations
from core.estimate.parameter_fit import Background, coarse_fit, fine_fit, held_fit
from core.estimate.parameter_step import Vector
from core.estimate.plane_openings import with_plane_openings
from core.estimate.posterior import Analysis, solution
from core.estimate.prior import room_prior
from core.problem import Problem
from core.result import Solution
from core.room.boundary_conditions import RoomLayout
from core.room.forward import carried_over, closure_name, room


def solve_room(
    problem: Problem, settings: RoomSettings = RoomSettings(), *, on_event: Event | None = None
) -> Solution:
    """T, p and u of the room, with standard deviations and sentences for the operator.

    Raises:
        SettingError: a boundary that cannot be (see `core.room.boundary_conditions`).
    """
    start_s = time.perf_counter()
    report: Event = on_event or (lambda _: None)
    return analyse(background_of(problem, settings, report), problem, settings, report, start_s=start_s)


def background_of(
    problem: Problem, settings: RoomSettings, report: Event, closure: str | None = None
) -> Background:
    """Forward runs of the room as stated on both grids, and derivatives on the coarse one: no image is used.

    `closure` replaces the scene's.
    """
    problem = with_plane_openings(problem)
    closure = closure or closure_name(problem.scene)
    coarse, fine = (room(problem.scene, n, closure) for n in (settings.coarse_cells, settings.cells))
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    prior = room_prior(
        problem, coarse.layout, log_viscosity_std=settings.log_viscosity_std, wall_heat=settings.wall_heat
    )
    base = run_as_stated(coarse, prior, problem, settings, vertices, report)
    flow = carried_over(base.flow.last, coarse.grid, fine.grid)
    first = march_under(fine, prior.mean, flow, settings.refine_s, vertices, report)
    derivatives = perturbed(coarse, prior, np.zeros(len(prior.active())), base, settings, vertices)
    # The unchanged restart has marched as long as the moved ones: it is what they are compared with.
    base = ForwardRun(base.parameters, base.flow, derivatives.start)
    return Background(problem, coarse, fine, prior, base, first, derivatives)


def analyse(
    background: Background, problem: Problem, settings: RoomSettings, report: Event, *, start_s: float
) -> Solution:
    """The solution for the shifts of `problem`, which may be another measurement of the background's room.

    If another closure, or a heater that nobody stated, may explain the images better, that room is fitted as well and
    the better one is taken.
    """
    analysis = fitted_room(background, problem, settings, report)
    notes: tuple[str, ...] = ()
    name = promising_closure(analysis, background.coarse) if settings.use_images else None
    if name is not None:
        again = fitted_room(
            background_of(background.problem, settings, report, name), problem, settings, report
        )
        if left_over(again) < left_over(analysis):
            notes = (another_closure(name, left_over(again), background.coarse.closure, left_over(analysis)),)
            analysis = again
    warm = suspected_heat(analysis, background, settings, report)
    if warm is not None:
        again = fitted_room(
            background_of(warm, settings, report, background.coarse.closure), problem, settings, report
        )
        if left_over(again) < KEEP_HEAT * left_over(analysis):
            notes, analysis = (), again
    report(supplied(analysis.layout, analysis.best))
    return solution(analysis, time.perf_counter() - start_s, use_images=settings.use_images, notes=notes)


def data_of(background: Background, problem: Problem, settings: RoomSettings) -> Observations:
    """The data of `problem`, with the openings of the background's room."""
    stated = background.problem
    of = Problem(stated.scene, problem.shifts, stated.planes, stated.sensors)
    return observations(of, (settings.vertices, settings.vertices, settings.vertices))


def fitted_room(background: Background, problem: Problem, settings: RoomSettings, report: Event) -> Analysis:
    """The fit: parameters, then the level of T, and everything that the standard deviations need."""
    coarse, fine, prior = background.coarse, background.fine, background.prior
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    data = data_of(background, problem, settings)
    vector, base, linearised = coarse_fit(background, data, settings, report)
    other = run_under_other_closure(coarse, prior.parameters(vector), base, settings, vertices)
    first = background.first
    seconds = settings.refine_s + (0.0 if settings.use_images else settings.final_s)
    if np.any(vector) or not settings.use_images:
        first = march_under(fine, prior.parameters(vector), first.flow.last, seconds, vertices, report)

    def renewed(where: Vector) -> Derivatives:
        return perturbed(coarse, prior, where, base, settings, vertices)

    derivatives = linearised
    if settings.use_images and prior.unknown_walls():
        found, derivatives = fine_search(fine, prior, data, first, linearised, renewed, settings, report)
    else:
        found = fine_fit(fine, prior, data, vector, first, linearised, settings, report)
    before = best = found.room
    if settings.use_images:
        best = held_fit(fine, prior, data, before, derivatives, settings, report)
    return Analysis(
        background.problem,
        data,
        prior,
        found.posterior,
        derivatives,
        coarse=linearised.start,
        first=first.fields,
        other=other,
        before=before,
        best=best,
        layout=fine.layout,
    )


def supplied(layout: RoomLayout, best: ForwardRun) -> dict[str, float]:
    """Excess temperature and speed of every supply in the fitted room."""
    found: dict[str, float] = {}
    for n, velocity in enumerate(layout.inlet_velocity_m_s):
        speed = float(np.linalg.norm(velocity)) * float(np.exp(best.parameters.inlet_log_flow[n]))
        found |= {
            f"supply_{n + 1}_excess_k": float(best.parameters.inlet_excess_k[n]),
            f"supply_{n + 1}_m_s": speed,
        }
    return found
