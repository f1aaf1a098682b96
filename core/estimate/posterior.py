"""The result of a fit: T with its last correction, p, u, their standard deviations, and sentences."""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid

from core.air import GRAVITY_M_S2
from core.continuity import left_out
from core.data_error import LENGTH_SHARE
from core.estimate.diagnostics import (
    balances,
    contradictions,
    doubtful,
    misfit,
    other_way,
    undetermined,
)
from core.estimate.discrepancy import Correction
from core.estimate.explained import explained, likeness
from core.estimate.forward_runs import Derivatives, ForwardRun
from core.estimate.least_squares import Posterior
from core.estimate.model_error import ModelError, model_error
from core.estimate.observation import Observations
from core.estimate.prior import Prior
from core.estimate.temperature_levels import (
    free_vertices,
    last_correction,
    layer_means,
    layers_k,
    surfaces_std_k,
)
from core.estimate.uncertainty import Deviation, deviation, errors_of
from core.problem import Problem
from core.result import Solution
from core.room.boundary_conditions import RoomLayout
from core.room.vertices import RoomFields
from core.shared_errors import broad, shared_errors

# If the thermometers moved the level of T, half of that move is added to its standard deviation: they stand in a few
# places, and the model was wrong there.
_DOUBT = 0.5

# Shapes of the profile whose errors all places have together: so many correlation lengths are in the height.
_SHAPES = round(1 / LENGTH_SHARE)


class Analysis(eqx.Module):
    """A fitted room with everything that its solution and standard deviations are made of.

    `stated_room` is the room as stated, `coarse` the same on the coarse grid, and `other` that under another closure.
    `best` is the run under the fitted parameters.
    `outlet_std_k` is how far what leaves may be from the air at the outlets' height. `rival` is the room that was
    fitted with heat that nobody stated and explains the images about as well; None if there is none.
    """

    problem: Problem
    data: Observations
    prior: Prior
    posterior: Posterior
    stated_room: RoomFields
    derivatives: Derivatives
    coarse: RoomFields
    other: RoomFields
    best: ForwardRun
    layout: RoomLayout
    outlet_std_k: float
    rival: RoomFields | None = None


def solution(
    analysis: Analysis, seconds: float, *, use_images: bool, notes: tuple[str, ...] = ()
) -> Solution:
    """The result: fields, standard deviations, and sentences after `notes`; T with its last correction."""
    fields, box, problem = analysis.best.fields, analysis.problem.scene.room, analysis.problem
    free = free_vertices(analysis.layout, fields.excess_k.shape)
    change = last_correction(analysis.data, analysis.derivatives, fields, analysis.outlet_std_k)
    x, y, z = (np.linspace(box.lower_m[a], box.upper_m[a], n) for a, n in enumerate(fields.excess_k.shape))
    change_k = change.excess_k * free if use_images else np.zeros_like(free)
    moved_k = float(layer_means(change_k).mean())
    variances = change.prior_variance_k2, change.variance_k2
    before, after = ((v + (_DOUBT * moved_k) ** 2) * free for v in variances)
    bent = hydrostatic_variance_m4_s4(problem, z, before), hydrostatic_variance_m4_s4(problem, z, after)
    shown_k = fields.excess_k + change_k
    surfaces_k = surfaces_std_k(
        analysis.data, analysis.layout, analysis.best.parameters.wall_excess_k, shown_k
    )
    error = model_error_of(analysis)
    slopes = analysis.derivatives.per_deviation(lambda run: run.excess_k)
    beside_k = free * layers_k(error.apart("excess_k", slopes))
    of_points = change.point_k2 * free + np.square(surfaces_k) + np.sum(np.square(beside_k), axis=0)
    # The correction holds what the model has wrong in T, where a picture can tell.
    temperature = _deviation(analysis, "excess_k", None, (before + of_points, after + of_points))
    pressure = _deviation(analysis, "pressure_m2_s2", error, bent)
    velocity = _deviation(analysis, "velocity_m_s", error)
    doubt = doubt_of_velocity(analysis, error)
    return Solution(
        x,
        y,
        z,
        problem.scene.air.ambient_temperature_k + shown_k,
        fields.pressure_m2_s2 + hydrostatic_m2_s2(problem, z, change_k),
        fields.velocity_m_s,
        temperature.std,
        pressure.std,
        velocity.std,
        temperature.informed,
        temperature_shared_k=np.concatenate(
            [_shared_k(analysis, slopes, change, _DOUBT * moved_k, free), np.moveaxis(beside_k, 0, -1)],
            axis=-1,
        ),
        outcome=analysis.best.flow.outcome,
        solver_s=seconds,
        notes=(*notes, *sentences(analysis, error, doubt, moved_k, change.level_std_k)),
    )


def sentences(
    analysis: Analysis, error: ModelError, doubt: float, moved_k: float, level_std_k: float
) -> list[str]:
    """Sentences for the operator.

    `doubt` is the expected error of the velocity over its size, both rms; `moved_k` how far measurements moved the
    level of T, and `level_std_k` how well they know it.
    """
    parameters = analysis.best.parameters
    inflow = np.asarray(analysis.layout.inflow_m3_s(parameters), float)
    return [
        *analysis.layout.notes,
        *undetermined(analysis.problem),
        *left_out(analysis.data.moved),
        *contradictions(analysis.problem, analysis.prior, analysis.posterior, error.moves, doubt),
        *misfit(analysis.data, explained(analysis.data, analysis.best.fields), error),
        *doubtful(doubt),
        *other_way(likeness(analysis.data, analysis.stated_room)),
        *balances(parameters, inflow, outflow_excess_k(analysis), analysis.problem, moved_k, level_std_k),
    ]


def model_error_of(analysis: Analysis) -> ModelError:
    """What the model has wrong: as two closures differ, and two grids, and as the room and its rival do."""
    found = analysis.best.fields
    pairs = (analysis.coarse, analysis.other), (analysis.coarse, analysis.stated_room)
    rival = None if analysis.rival is None else (found, analysis.rival)
    return model_error(analysis.data, analysis.posterior, analysis.derivatives, pairs, found, rival)


def doubt_of_velocity(analysis: Analysis, error: ModelError) -> float:
    """How wrong the velocity is expected to be over the room, over its size, both rms."""
    slopes = analysis.derivatives.per_deviation(lambda run: run.velocity_m_s)
    by_parameters = rms(deviation(slopes, analysis.posterior.covariance, 0.0).std)
    by_model = error.mean_square("velocity_m_s", slopes) ** 0.5
    size = max(rms(analysis.best.fields.velocity_m_s), float(np.finfo(np.float32).tiny))
    return float(np.hypot(by_parameters, by_model)) / size


def outflow_excess_k(analysis: Analysis) -> float:
    """Mean over the outlets, weighted with what leaves by each; 0 in a room without any."""
    return float(np.dot(analysis.layout.outlet_shares, analysis.best.fields.outflow_excess_k))


def hydrostatic_m2_s2(
    problem: Problem, z_m: Float[np.ndarray, " vz"], warmer_k: Float[np.ndarray, "vx vy vz"]
) -> Float[np.ndarray, " vz"]:
    """Hydrostatic pressure of a change of T: dp/dz = g beta dT, from the mean change at each height."""
    buoyancy = GRAVITY_M_S2 * problem.scene.air.expansion_per_k * warmer_k.mean((0, 1))
    return cumulative_trapezoid(buoyancy, z_m, initial=0.0)


def hydrostatic_variance_m4_s4(
    problem: Problem, z_m: Float[np.ndarray, " vz"], variance_k2: Float[np.ndarray, "vx vy vz"]
) -> Float[np.ndarray, "vx vy vz"]:
    """Variance of p, about its mean over height, from an error of T that is the same sign at all heights."""
    carried = hydrostatic_m2_s2(problem, z_m, np.sqrt(variance_k2))
    return np.broadcast_to(np.square(carried - carried.mean()), variance_k2.shape)


def rms(field: Float[np.ndarray, "..."]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(field))))


def _shared_k(
    analysis: Analysis,
    slopes: Float[np.ndarray, "active vx vy vz"],
    change: Correction,
    level_k: float,
    free: Float[np.ndarray, "vx vy vz"],
) -> Float[np.ndarray, "vx vy vz errors"]:
    """Errors of T that all places have together: of the parameters, of the last correction, and of its level.

    `slopes` are the derivatives of T, per prior deviation.
    """
    known = errors_of(slopes, analysis.posterior.covariance)
    independent = np.concatenate([known, level_k * free[None]])
    rows = [
        np.tensordot(np.tensordot(independent, weights, axes=3), independent, axes=1)
        + free * change.goes_with(free * weights)
        for weights in broad(free.shape, _SHAPES)
    ]
    return np.moveaxis(shared_errors(np.stack(rows)).fields, 0, -1)


def _deviation(
    analysis: Analysis,
    name: str,
    error: ModelError | None,
    extra: tuple[np.ndarray | float, np.ndarray | float] = (0.0, 0.0),
) -> Deviation:
    derivatives = analysis.derivatives.per_deviation(lambda run: getattr(run, name))
    model_std = error.deviation(name, derivatives) if error else 0.0
    return deviation(derivatives, analysis.posterior.covariance, model_std, extra)
