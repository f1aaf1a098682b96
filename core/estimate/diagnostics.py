"""Sentences for the operator: heat balance, entries that the images contradict, what not to trust."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from core.estimate.explained import Explained
from core.estimate.least_squares import Posterior
from core.estimate.model_error import ModelError
from core.estimate.observation import Observations
from core.estimate.prior import Prior, looked_through
from core.known import leaving_excess_k, stated_walls, unknown_walls
from core.problem import Problem
from core.room.boundary_conditions import MeasuredWall, RoomParameters, SuspectedHeater
from core.scene import Driving, Heater, Inlet
from core.significance import EITHER_WAY, FALSE_ALARMS
from core.view_frame import told_on_floor

# Missing heat is reported above this share of the heat that the supplies bring.
_MISSING_SHARE = 0.1
# The velocity is called doubtful if more than this share of it (rms) is expected to be wrong.
_DOUBTFUL = 0.5
# Correlation of the measured shifts with those of the room as stated, below which they went the other way.
_OTHER_WAY = -0.5
# The place of heat is called uncertain if it spans more than so many panels: each overlaps its neighbours by half.
_WIDE = 2.0
# A floor panel is reported if it is warmer, or colder, than the air by at least this.
_SUSPICIOUS_K = 8.0


def moved_too_far(
    prior: Prior, posterior: Posterior, by_model: Float[np.ndarray, " active"]
) -> dict[str, float]:
    """The parameters that the fit moved too far, and how many times as far as entry and model may be wrong.

    `by_model` is how far what the model has wrong moves each parameter, one standard deviation, in prior deviations.
    Where entries are as right as stated and the model as wrong as that, one room in twenty has any.
    """
    doubt = np.sqrt(1.0 + by_model**2)
    limit = float(ndtri(1.0 - FALSE_ALARMS / (2.0 * max(len(doubt), 1))))
    times = zip(prior.names(), np.abs(posterior.vector) / doubt, strict=True)
    return {name: float(n) for name, n in times if n > limit}


def contradictions(
    problem: Problem,
    prior: Prior,
    posterior: Posterior,
    by_model: Float[np.ndarray, " active"],
    doubt_of_velocity: float = 0.0,
) -> list[str]:
    """One sentence for each entered value that the measurements contradict: those of `moved_too_far`.

    Where the velocity is doubtful (`doubtful`) there is none: what is wrong with the model moves entries as well.
    """
    fitted = prior.parameters(posterior.vector)
    believed = moved_too_far(prior, posterior, by_model) if doubt_of_velocity <= _DOUBTFUL else {}
    inlets = [b for b in problem.scene.boundary if isinstance(b, Inlet)]
    heaters = [b for b in problem.scene.boundary if isinstance(b, Heater)]
    said = []
    for n, inlet in enumerate(inlets):
        where = f"inlet {n + 1} on {inlet.patch.wall}"
        if (name := f"inlet_excess_k[{n}]") in believed:
            by_k = float(fitted.inlet_excess_k[n] - prior.mean.inlet_excess_k[n])
            said.append(_warmer(where, by_k, inlet.temperature_k, believed[name]))
        if (name := f"inlet_log_flow[{n}]") in believed:
            said.append(
                f"The measurements say that {where} supplies {float(np.exp(fitted.inlet_log_flow[n])):.2f} times the "
                f"velocity entered, {_evidence(believed[name])}. Check it."
            )
    above_air_k = np.asarray(fitted.heater_excess_k) - (leaving_excess_k(problem) or 0.0)
    suspected_k = [
        float(k)
        for k, heater in zip(above_air_k, heaters, strict=True)
        if isinstance(heater, SuspectedHeater)
    ]
    source_k = max(suspected_k, key=abs, default=0.0)
    for n, heater in enumerate(heaters):
        by_k = float(fitted.heater_excess_k[n] - prior.mean.heater_excess_k[n])
        if isinstance(heater, SuspectedHeater):
            # Panels beside a source tell where it ends: a cold one beside a warm one is no source of its own.
            if above_air_k[n] * source_k > 0:
                said += suspicion(problem, heater, float(above_air_k[n]))
        elif (name := f"heater_excess_k[{n}]") in believed:
            where = f"the heater on {heater.patch.wall}"
            said.append(_warmer(where, by_k, heater.temperature_k, believed[name]))
    said += objects_heat(problem, prior, posterior, believed)
    if "log_closure" in believed:
        said.append(
            f"The measurements ask for {float(np.exp(fitted.log_closure)):.2f} times the closure's eddy "
            "viscosity: another closure may describe this room better."
        )
    return said


def _warmer(where: str, by_k: float, entered_k: float, times: float) -> str:
    return (
        f"The measurements say that {where} is {abs(by_k):.1f} K {'warmer' if by_k > 0 else 'colder'} than the "
        f"{entered_k:.2f} K entered, {_evidence(times)}. Check it."
    )


def _evidence(times: float) -> str:
    return f"{times:.1f} times what the entry and the model may be wrong by"


def objects_heat(
    problem: Problem, prior: Prior, posterior: Posterior, believed: dict[str, float]
) -> list[str]:
    """The fitted heat of each object of stated power, with its 95 % interval."""
    fitted = prior.parameters(posterior.vector)
    own = dict(zip(prior.names(), np.sqrt(np.diag(posterior.covariance)), strict=True))
    said = []
    for n, item in enumerate(problem.scene.objects):
        name = f"object_power_w[{n}]"
        if name not in own:
            continue
        watts, spread = float(fitted.object_power_w[n]), EITHER_WAY * item.power_std_w * float(own[name])
        text = (
            f"The object {item.name!r} gives {watts:.0f} W to the air (95 %: {watts - spread:.0f} to "
            f"{watts + spread:.0f} W; entered: {item.power_w:.0f} W)."
        )
        said.append(
            text + (f" It was moved {_evidence(believed[name])}. Check it." if name in believed else "")
        )
    return said


def suspicion(problem: Problem, heater: SuspectedHeater, by_k: float) -> list[str]:
    """A sentence about a panel of floor that the fit made `by_k` warmer than the air; none if it is small."""
    if abs(by_k) < _SUSPICIOUS_K:
        return []
    lower, upper = heater.patch.lower_m, heater.patch.upper_m
    size = " x ".join(f"{high - low:.2f}" for low, high in zip(lower, upper, strict=True))
    place, assumed = _place_on_floor(problem, heater)
    return [
        f"The images ask for {'heat' if by_k > 0 else 'cold'} that is not in the scene: as of a floor panel of "
        f"{size} m, {abs(by_k):.0f} K {'warmer' if by_k > 0 else 'colder'} than the air, at {place}. {assumed}"
        "State it as a heater."
    ]


def missing_heat(problem: Problem, panel: SuspectedHeater, likeness: float) -> str:
    """A sentence about a panel of floor where heat may be missing that the room's fit could not make use of."""
    place, assumed = _place_on_floor(problem, panel)
    return (
        f"Heat on the floor at {place} would change the pictures as what is left unexplained differs (correlation "
        f"{likeness:.2f}), but a room that is fitted with it leaves nearly as much. {assumed}Look for a source that "
        "rises there; if there is none, something else is not as stated."
    )


def where_else(panel: SuspectedHeater, spans_m: Iterable[tuple[int, float, float]]) -> tuple[str, ...]:
    """A sentence for each axis along which heat may stand elsewhere than on this panel."""
    width_m = np.subtract(panel.patch.upper_m, panel.patch.lower_m)
    return tuple(
        f"The images do not tell well where along {'xy'[axis]} this heat stands: it may be anywhere from {low_m:.1f} "
        f"to {high_m:.1f} m (95 %)."
        for axis, low_m, high_m in spans_m
        if high_m - low_m > _WIDE * width_m[axis]
    )


def _place_on_floor(problem: Problem, panel: SuspectedHeater) -> tuple[str, str]:
    """Where a panel lies along the axes that some view tells, and a sentence about an axis that none tells."""
    bounds = zip("xy", panel.patch.lower_m, panel.patch.upper_m, strict=True)
    spans = [f"{axis} = {low:.1f} to {high:.1f} m" for axis, low, high in bounds]
    told = told_on_floor(problem.scene)
    unseen = "".join(axis for n, axis in enumerate("xy") if n not in told)
    assumed = f"No view tells where along {unseen} it is; the middle was assumed. " if unseen else ""
    return ", ".join(spans[n] for n in told), assumed


def misfit(data: Observations, seen: Explained, error: ModelError) -> list[str]:
    """How much of the measured shifts is left unexplained, with a warning where the room lacks something."""
    if not data.shifts:
        return []
    share = seen.share_left
    said = f"{100 * share:.0f} % (rms) of the measured shifts is left unexplained by the fitted room"
    if not seen.stands_out:
        return [f"{said}, no more than their noise may be misjudged by."]
    if not missing(seen, error):
        return [f"{said}."]
    return [
        f"{said}, more than {'half' if seen.half_left else 'models of the air differ in'}.",
        "The stated boundary cannot explain these images. Check inlets, outlets and heaters for something that is "
        "not in the scene; until it is stated, distrust the velocity.",
    ]


def missing(seen: Explained, error: ModelError) -> bool:
    """Whether a room leaves more than the noise, and more than half or than models of the air differ in."""
    return seen.stands_out and (seen.half_left or error.lacks)


def doubtful(share: float) -> list[str]:
    """How wrong the velocity is expected to be, over its size (both rms), with a warning if it is much."""
    much = f"{100 * share:.0f} % of its size (rms)" if share < 1.0 else "its whole size (rms) or more"
    said = f"The velocity is expected to be wrong by {much}"
    if share <= _DOUBTFUL:
        return [f"{said}."]
    return [
        f"{said}: distrust the velocity. State what you can of the walls' temperatures and of all else that warms or "
        "moves the air: it tells more than more pictures do."
    ]


def other_way(likeness: float) -> list[str]:
    """A sentence if the pictures moved against the room as stated; `likeness` is the correlation of both."""
    if likeness > _OTHER_WAY:
        return []
    return [
        f"The pictures moved the other way than the room as stated would move them (correlation {likeness:.2f}). "
        "Reference and flow may be swapped, or a warm supply is entered as a cold one: check both."
    ]


def another_closure(name: str, left: float, stated: str, stated_left: float) -> str:
    """A sentence that says which closure was taken, and why."""
    # As many digits as tell the two apart.
    digits = next((n for n in range(3) if f"{100 * left:.{n}f}" != f"{100 * stated_left:.{n}f}"), 3)
    return (
        f"The images are explained better with {name} as the model of turbulence ({100 * left:.{digits}f} % of the "
        f"shifts left) than with {stated} ({100 * stated_left:.{digits}f} %): it was taken. State flow.transport to "
        "keep one."
    )


def balances(
    parameters: RoomParameters,
    inflows_m3_s: Float[np.ndarray, " inlets"],
    outflow_excess_k: float,
    problem: Problem,
    warmer_k: float = 0.0,
    warmer_std_k: float = 0.0,
) -> list[str]:
    """The room's heat balance in words, and a warning if heat is missing.

    `warmer_k` is how much warmer thermometers say that the air is than the room of these parameters, `warmer_std_k`
    its standard deviation, which holds how far outlets may be from the air beside them. Heat is called missing if it
    is more than a tenth of what supplies and objects bring, and more than chance gives in one room of twenty.
    """
    inflow_m3_s = float(inflows_m3_s.sum())
    if inflow_m3_s <= 0:
        return []
    capacity_w_m3_k = problem.scene.air.heat_capacity_j_m3_k
    brought = capacity_w_m3_k * float(np.dot(inflows_m3_s, np.asarray(parameters.inlet_excess_k)))
    by_objects = float(parameters.object_power_w.sum())
    carried = capacity_w_m3_k * inflow_m3_s * outflow_excess_k
    added = f", objects give {by_objects:.0f} W" if problem.scene.objects else ""
    said = [
        f"Supply air brings {brought:.0f} W above ambient{added}; {carried:.0f} W leave by the outlets and "
        f"{brought + by_objects - carried:.0f} W through walls and heaters. {3600 * inflow_m3_s:.0f} m3/h flow "
        "through."
    ]
    missing = capacity_w_m3_k * inflow_m3_s * warmer_k
    much = abs(missing) > _MISSING_SHARE * (abs(brought) + abs(by_objects))
    if much and abs(warmer_k) > EITHER_WAY * warmer_std_k:
        said.append(
            f"The air is measured {abs(warmer_k):.2g} K {'warmer' if warmer_k > 0 else 'colder'} than the fitted "
            f"room (95 %: +- {EITHER_WAY * warmer_std_k:.2g} K): {abs(missing):.0f} W "
            f"{'more' if missing > 0 else 'less'} leave with it than supply, heaters and walls give it. A source, a "
            "leak or a wall is not as stated."
        )
    return said


def undetermined(problem: Problem) -> list[str]:
    """One sentence on what the stated information cannot determine; none if all is stated."""
    driving = [b for b in problem.scene.boundary if isinstance(b, Driving)]
    if all(isinstance(b, SuspectedHeater) for b in driving):
        return [
            "No inlet or heater is stated, so nothing says what drives the air. These measurements do not "
            "determine the velocity: the one given is that of air driven by the walls alone. Do not use it."
        ]
    walls = stated_walls(problem.scene)
    if all(wall is None or isinstance(wall, MeasuredWall) for wall in walls.values()):
        return [
            "No wall is stated. Openings, and the temperature of their wall, were read off the plane of known "
            "velocity; the other walls' temperatures were fitted, and anything else that drives the air is missing. "
            "These measurements do not determine the velocity: the one given is the room model's guess. State the "
            "walls to use it."
        ]
    unknown = unknown_walls(problem.scene)
    if unknown:
        through = looked_through(problem.scene)
        alike = ""
        if through and set(through) <= set(unknown):
            alike = (
                f" ({' and '.join(through)} as one: the camera looks through both, and a second one from the side "
                "would tell them apart)"
            )
        return [
            f"The heat through {', '.join(unknown)} is not stated; it was fitted to the measurements{alike}. "
            "The velocity depends on it: stating a wall's temperature, or 'adiabatic', helps more than more frames."
        ]
    return []
