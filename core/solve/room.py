"""`standard` and `reference`: a room marched in time, with its boundary corrected by the measurements.

A coarse room is marched to a steady state, a finer one starts from it, and the fit (`core.estimate`) corrects what
was stated. Standard deviations come from the parameters' posterior and from the differences of two grids and of two
closures. core/estimate/README.md has the method.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from core.checkpoint import digest
from core.estimate.alternatives import (
    explains_more,
    left_over,
    promising_closure,
    stated_eddies,
    suspected_heat,
    worth_large_eddies,
    worth_naming,
)
from core.estimate.diagnostics import another_closure, missing_heat, where_else
from core.estimate.forward_runs import (
    EDDIES_LONGER,
    Derivatives,
    ForwardRun,
    RoomSettings,
    march_under,
    perturbed,
    run_as_stated,
    run_under_other_closure,
)
from core.estimate.image_noise import with_noise_seen
from core.estimate.marches import Marches, work
from core.estimate.observation import Observations, observations
from core.estimate.parameter_fit import Background, Fit, search
from core.estimate.parameter_step import Vector, misfit_ratio
from core.estimate.plane_openings import refuse_walls_alone, with_planes_read
from core.estimate.posterior import Analysis, solution
from core.estimate.prior import room_prior
from core.estimate.schedule import fit_work
from core.estimate.temperature_levels import outlets_apart_k
from core.estimate.unstated_heat import with_suspected_heat
from core.problem import Problem
from core.result import Solution
from core.room.boundary_conditions import RoomLayout
from core.room.forward import LARGE_EDDIES, carried_over, closure_name, room
from core.watch import Watch

# Most rounds of a fit with large eddies: a march of them costs some four times what one of a closure does.
_EDDY_ROUNDS = 3
# A room whose large eddies leave so many times the misfit of its closure is left as it is.
_HOPELESS = 1.5


def solve_room(problem: Problem, settings: RoomSettings = RoomSettings(), watch: Watch = Watch()) -> Solution:
    """T, p and u of the room, with standard deviations and sentences for the operator.

    A solve that `watch.store` knows of takes its marches from there, goes on with those that were cut, and ends
    bitwise as it would have on a CPU. A stop is heard between two chunks of time steps.

    Raises:
        SettingError: a boundary that cannot be (see `core.room.boundary_conditions`).
        ForeignCheckpointError: the store belongs to another problem or to other settings.
        StoppedError: a stop was asked for.
    """
    marches = Marches(watch, digest(problem, replace(settings, threads=1)))
    return analyse(background_of(problem, settings, marches), problem, settings, marches)


def background_of(
    problem: Problem, settings: RoomSettings, marches: Marches, closure: str | None = None
) -> Background:
    """Forward runs of the room as stated on both grids, and derivatives on the coarse one: no image is used.

    `closure` replaces the scene's.
    """
    problem = with_planes_read(problem)
    refuse_walls_alone(problem)
    closure = closure or closure_name(problem.scene)
    coarse, fine = (room(problem.scene, n, closure) for n in (settings.coarse_cells, settings.cells))
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    prior = room_prior(problem, coarse.layout, closure, wall_heat=settings.wall_heat)
    marches.expect(fit_work(coarse, fine, prior, settings))
    base = run_as_stated(coarse, prior, problem, settings, vertices, marches)
    flow = carried_over(base.flow.last, coarse.grid, fine.grid)
    doing = "march the fine room as stated"
    first = march_under(fine, prior.mean, flow, settings.refine_s, vertices, marches, doing=doing)
    start, spread = np.zeros(len(prior.active())), np.ones(len(prior.active()))
    derivatives, base = perturbed(coarse, prior, start, spread, base, settings, vertices, marches)
    return Background(problem, coarse, fine, prior, base, first, derivatives)


def analyse(background: Background, problem: Problem, settings: RoomSettings, marches: Marches) -> Solution:
    """The solution for the shifts of `problem`, which may be another measurement of the background's room.

    If another closure, a heater that nobody stated, or large eddies may explain the images better, that room is
    fitted as well and the better one is taken. Heat comes before eddies: these need what drives them.
    """
    analysis = fitted_room(background, problem, settings, marches)
    of_closure: tuple[str, ...] = ()
    of_heat: tuple[str, ...] = ()
    closure = background.coarse.closure
    name = promising_closure(analysis, background.coarse) if settings.use_images else None
    if name is not None:
        again = fitted_room(
            background_of(background.problem, settings, marches, name), problem, settings, marches
        )
        if left_over(again) < left_over(analysis):
            of_closure = (another_closure(name, left_over(again), closure, left_over(analysis)),)
            analysis, closure = again, name
    suspect = suspected_heat(analysis, background, settings, marches)
    if suspect is not None:
        warm = with_suspected_heat(background.problem, suspect)
        name = background.coarse.closure
        again = fitted_room(background_of(warm, settings, marches, name), problem, settings, marches)
        if explains_more(again, analysis):
            of_closure, of_heat = (), where_else(suspect.panel, suspect.spans_m)
            analysis, closure, suspect = again, name, None
        elif not explains_more(analysis, again):
            analysis = replace(analysis, rival=again.best.fields)
    if worth_large_eddies(analysis, settings):
        again = with_large_eddies(analysis, settings, marches)
        if stated_eddies(analysis):
            analysis = again
        elif left_over(again) < left_over(analysis):
            of_closure = (another_closure(LARGE_EDDIES, left_over(again), closure, left_over(analysis)),)
            analysis = again
    if suspect is not None and worth_naming(suspect, analysis):
        said = missing_heat(problem, suspect.panel, suspect.likeness)
        of_heat = (said, *where_else(suspect.panel, suspect.spans_m))
    doing = "take the room that was found"
    marches.record({"doing": doing, **supplied(analysis.layout, analysis.best)})
    found = solution(
        analysis, marches.elapsed_s, use_images=settings.use_images, notes=(*of_closure, *of_heat)
    )
    return replace(found, history=tuple(marches.history))


def data_of(background: Background, problem: Problem, settings: RoomSettings) -> Observations:
    """The data of `problem`, with the openings of the background's room."""
    stated = background.problem
    of = Problem(stated.scene, problem.shifts, stated.planes, stated.sensors)
    return observations(of, (settings.vertices, settings.vertices, settings.vertices))


def fitted_room(
    background: Background, problem: Problem, settings: RoomSettings, marches: Marches
) -> Analysis:
    """The fit: parameters, then the level of T, and everything that the standard deviations need."""
    coarse, fine, prior = background.coarse, background.fine, background.prior
    vertices = (settings.vertices, settings.vertices, settings.vertices)
    data = with_noise_seen(data_of(background, problem, settings), background.first.fields)
    base, derivatives = background.base, background.derivatives
    found = Fit.begun(np.zeros(len(prior.active())), background.first)
    other = run_under_other_closure(coarse, prior, found.posterior.vector, base, settings, vertices, marches)

    def renewed(where: Vector, spread: Vector) -> Derivatives:
        nonlocal base
        slopes, base = perturbed(coarse, prior, where, spread, base, settings, vertices, marches)
        return slopes

    if settings.use_images:
        found, derivatives = search(fine, prior, data, found, derivatives, settings, marches, renewed)
    best, stated, stated_coarse = found.room, background.first.fields, background.derivatives.start
    pairs = (other, stated_coarse), (stated, best.fields)
    return Analysis(
        background.problem,
        data,
        prior,
        found.posterior,
        stated,
        derivatives,
        coarse=stated_coarse,
        other=other,
        best=best,
        layout=fine.layout,
        outlet_std_k=outlets_apart_k(data, best.fields, pairs),
    )


def with_large_eddies(analysis: Analysis, settings: RoomSettings, marches: Marches) -> Analysis:
    """The room fitted again with its large eddies marched (`core.room.eddies`), from where `analysis` ended.

    Every entry is taken as it was entered, and what nobody entered, such as heat, as `analysis` has it. Derivatives
    are those of `analysis`: eddies differ from march to march, so a difference of two marches is no derivative. A
    room whose first march fits far worse is not corrected, unless the scene asks for eddies.
    """
    data, kept = analysis.data, [n for n, name in enumerate(analysis.prior.names()) if name != "log_closure"]
    unentered = analysis.prior.gaussian() | analysis.prior.suspected()
    found = np.where(unentered, analysis.posterior.vector, 0.0)[kept]
    prior = eqx.tree_at(lambda p: p.std.log_closure, analysis.prior, jnp.float32(0.0))
    slopes = analysis.derivatives
    slopes = Derivatives(slopes.start, [slopes.others[n] for n in kept], slopes.apart[np.ix_(kept, kept)])
    fine = room(analysis.problem.scene, settings.cells, LARGE_EDDIES)
    marches.expect((1 + _EDDY_ROUNDS) * EDDIES_LONGER * work(fine.grid, settings.refine_s))
    where, flow, doing = prior.parameters(found), analysis.best.flow.last, "march the room's large eddies"
    first = march_under(fine, where, flow, settings.refine_s, data.vertices, marches, doing=doing)
    hopeless = misfit_ratio(data, first, analysis.best) > _HOPELESS and not stated_eddies(analysis)
    rounds = 0 if hopeless else min(settings.rounds, _EDDY_ROUNDS)
    begun = Fit.begun(found, first)
    fit, _ = search(fine, prior, data, begun, slopes, replace(settings, rounds=rounds), marches)
    return replace(
        analysis, prior=prior, posterior=fit.posterior, derivatives=slopes, best=fit.room, layout=fine.layout
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
