"""What a fit says to the operator: balances, entries that the images contradict, and what to distrust."""

import numpy as np
from jaxtyping import Float

from core.estimate.least_squares import Posterior
from core.estimate.observation import Observations
from core.estimate.prior import FITTED_AS_ONE, Prior
from core.known import leaving_excess_k, stated_walls, unknown_walls
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters, SuspectedHeater
from core.scene import Heater, Inlet

# An entry is contradicted when the fit moves it by this many of its stated deviations, and of its own.
_SIGMAS = 2.0
# Of the heat that supplies bring: what is missing beyond that is said.
_MISSING_SHARE = 0.1
_POOR_FIT = 0.35
# Of a panel's temperature above the air: less is no heater.
_SUSPICIOUS_K = 8.0


def contradictions(problem: Problem, prior: Prior, posterior: Posterior) -> list[str]:
    """Sentences about entered values that the measurements do not believe."""
    fitted = prior.parameters(posterior.vector)
    moved = dict(zip(prior.names(), posterior.vector, strict=True))
    own = dict(zip(prior.names(), np.sqrt(np.diag(posterior.covariance)), strict=True))
    believed = {n for n, v in moved.items() if abs(v) > _SIGMAS and abs(v) > _SIGMAS * own[n]}
    inlets = [b for b in problem.scene.boundary if isinstance(b, Inlet)]
    heaters = [b for b in problem.scene.boundary if isinstance(b, Heater)]
    said = []
    for n, inlet in enumerate(inlets):
        if f"inlet_excess_k[{n}]" in believed:
            by_k = float(fitted.inlet_excess_k[n] - prior.mean.inlet_excess_k[n])
            said.append(
                f"The measurements say that inlet {n + 1} on {inlet.patch.wall} is "
                f"{abs(by_k):.1f} K {'warmer' if by_k > 0 else 'colder'} than the "
                f"{inlet.temperature_k:.2f} K entered. Check it."
            )
        if f"inlet_log_flow[{n}]" in believed:
            factor = float(np.exp(fitted.inlet_log_flow[n]))
            said.append(
                f"The measurements say that inlet {n + 1} on {inlet.patch.wall} supplies {factor:.2f} "
                "times the velocity entered. Check it."
            )
    for n, heater in enumerate(heaters):
        by_k = float(fitted.heater_excess_k[n] - prior.mean.heater_excess_k[n])
        if isinstance(heater, SuspectedHeater):
            said += suspicion(heater, float(fitted.heater_excess_k[n]) - (leaving_excess_k(problem) or 0.0))
        elif f"heater_excess_k[{n}]" in believed:
            said.append(
                f"The measurements say that the heater on {heater.patch.wall} is "
                f"{abs(by_k):.1f} K {'warmer' if by_k > 0 else 'colder'} than the "
                f"{heater.temperature_k:.2f} K entered. Check it."
            )
    if "log_closure" in believed:
        said.append(
            f"The measurements ask for {float(np.exp(fitted.log_closure)):.2f} times the closure's eddy "
            "viscosity: another closure may describe this room better."
        )
    return said


def suspicion(heater: SuspectedHeater, by_k: float) -> list[str]:
    """What the images say of a strip of floor `by_k` warmer than the air, where it is worth saying."""
    if abs(by_k) < _SUSPICIOUS_K:
        return []
    lower, upper = heater.patch.lower_m, heater.patch.upper_m
    size = " x ".join(f"{high - low:.2f}" for low, high in zip(lower, upper, strict=True))
    return [
        f"The images ask for {'heat' if by_k > 0 else 'cold'} that is not in the scene: as of a floor panel of "
        f"{size} m, {abs(by_k):.0f} K {'warmer' if by_k > 0 else 'colder'} than the air, at x = {lower[0]:.1f} to "
        f"{upper[0]:.1f} m. How deep in the room it is one view does not report: half-way was taken. State it as a "
        "heater."
    ]


def misfit(data: Observations, share: float) -> list[str]:
    """A sentence on how much of the measured shifts the room explains, with a warning when it is little."""
    if not data.shifts:
        return []
    said = [f"{100 * share:.0f} % (rms) of the measured shifts is left unexplained by the fitted room."]
    if share > _POOR_FIT:
        said.append(
            "The closure or the stated boundary cannot explain these images: distrust the velocity. Check "
            "inlets, outlets and heaters for something that is not in the scene."
        )
    return said


def another_closure(name: str, left: float, stated: str, stated_left: float) -> str:
    """Why a closure was taken that is not the default one."""
    return (
        f"The images are explained better under the {name} closure ({100 * left:.0f} % of the shifts left) than "
        f"under {stated} ({100 * stated_left:.0f} %): it was taken. State flow.transport to keep one."
    )


def balances(
    parameters: RoomParameters,
    inflows_m3_s: Float[np.ndarray, " inlets"],
    outflow_excess_k: float,
    problem: Problem,
    held_k_m3_s: float = 0.0,
) -> list[str]:
    """Heat that comes with the supplies and leaves through outlet and walls.

    `held_k_m3_s` is what keeping the measured temperatures took, over the whole room.
    """
    inflow_m3_s = float(inflows_m3_s.sum())
    if inflow_m3_s <= 0:
        return []
    capacity_w_m3_k = problem.scene.air.density_kg_m3 * 1006.0
    brought = capacity_w_m3_k * float(np.dot(inflows_m3_s, np.asarray(parameters.inlet_excess_k)))
    carried = capacity_w_m3_k * inflow_m3_s * outflow_excess_k
    said = [
        f"Supply air brings {brought:.0f} W above ambient; {carried:.0f} W leave by the outlets and "
        f"{brought - carried:.0f} W through walls and heaters. {3600 * inflow_m3_s:.0f} m3/h flow through."
    ]
    missing = capacity_w_m3_k * held_k_m3_s
    if abs(missing) > _MISSING_SHARE * abs(brought):
        said.append(
            f"The temperatures that were measured take {abs(missing):.0f} W {'more' if missing > 0 else 'less'} "
            "than supply, heaters and walls bring in the fitted room: a source, a leak or a wall is not as stated."
        )
    return said


def undetermined(problem: Problem) -> list[str]:
    """What the stated information cannot determine."""
    driving = [b for b in problem.scene.boundary if isinstance(b, Inlet | Heater)]
    if all(isinstance(b, SuspectedHeater) for b in driving):
        return [
            "No inlet or heater is stated: nothing says what drives the air. Velocity is not determined by "
            "these measurements; the one given is that of still air left to the walls, and is not to be used."
        ]
    walls = stated_walls(problem.scene)
    if all(wall is None for wall in walls.values()):
        return [
            "No wall is stated: openings were taken from the plane of known velocity, the walls' temperatures "
            "were fitted, and anything else that drives the air is missing. Velocity is not determined by "
            "these measurements: the one given is a guess of the room model. State the walls to use it."
        ]
    unknown = unknown_walls(problem.scene)
    if unknown:
        alike = (
            " (y_min and y_max as one: the camera looks through both)"
            if set(FITTED_AS_ONE) <= set(unknown)
            else ""
        )
        return [
            f"What passes through {', '.join(unknown)} is not stated and was fitted to the measurements{alike}. "
            "Velocity hinges on it: a stated wall temperature, or 'adiabatic', is worth more than more frames."
        ]
    return []
