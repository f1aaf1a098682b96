"""Where the grid starts: still air in hydrostatic balance, as warm as what is known, or as `draft` finds.

All at once, level and stratification are the slowest to be found: a kelvin of T without its column of pressure
costs the momentum balance a thousandfold what the thermometer gains. So they are there from the start.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import RegularGridInterpolator

from core.known_temperature import known_air_k
from core.losses.boussinesq import FlowValues
from core.losses.representation import Spans, positions
from core.problem import Problem
from core.scene import SolveModel
from core.solve.draft.draft import solve_draft
from core.solve.draft.temperature_prior import TemperatureSettings
from core.solve.nondimensional import RoomFrame, height_profile, outlet_height

# Enough to resolve a profile, in a second.
_DRAFT_CELLS = 24


def starting_flow(problem: Problem, frame: RoomFrame, spans: Spans, regime: str) -> FlowValues:
    """The known plane's profile; without one `draft`'s temperature where the regime uses images."""
    if problem.planes or not problem.shifts or "bos" not in regime or not known_air_k(problem):
        return height_profile(problem, frame, spans)
    scene = replace(problem.scene, solve=SolveModel(grid=_DRAFT_CELLS))
    found = solve_draft(replace(problem, scene=scene), TemperatureSettings(draws=0))
    lower, scales = frame.room.lower_m, frame.scales
    axes_m = [low + scales.length_m * positions(span) for low, span in zip(lower, spans, strict=True)]
    inside = [
        np.clip(a, own[0], own[-1]) for a, own in zip(axes_m, (found.x_m, found.y_m, found.z_m), strict=True)
    ]
    at = RegularGridInterpolator(
        (found.x_m, found.y_m, found.z_m), np.asarray(found.temperature_k, np.float64)
    )
    kelvin = at(np.stack(np.meshgrid(*inside, indexing="ij"), -1))
    temperature = (kelvin - scales.reference_k) / scales.excess_k
    column = frame.numbers.richardson * _column(temperature.mean((0, 1)), positions(spans[2]), problem, frame)
    pressure = np.broadcast_to(column, temperature.shape)
    return FlowValues(
        jnp.asarray(temperature, jnp.float32),
        jnp.asarray(pressure, jnp.float32),
        jnp.zeros((*temperature.shape, 3)),
    )


def _column(
    profile: Float[np.ndarray, " nz"], z: Float[np.ndarray, " nz"], problem: Problem, frame: RoomFrame
) -> Float[np.ndarray, " nz"]:
    """The integral of the profile from the outlets' height, where p is zero."""
    whole = cumulative_trapezoid(profile, z, initial=0.0)
    return whole - float(np.interp(outlet_height(problem, frame), z, whole))
