"""Heat coefficients of stated heaters, by marches: air above a warm one is a flow of its own, which no slope tells.

What a surface of stated temperature gives off depends on its air: tables and programs differ by a factor of four. So
the coarse room is marched with one heater after the other giving less, or more, until the images like it no better.
"""

import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import Event, ForwardRun, RoomSettings, march_under
from core.estimate.observation import Observations
from core.estimate.parameter_step import Vector, misfit_ratio
from core.estimate.prior import Prior
from core.room.forward import Room

# How far a heater's coefficient is moved at most, in prior deviations of 0.6 in the logarithm.
_FARTHEST = 2


def heaters_by_march(
    coarse: Room,
    prior: Prior,
    data: Observations,
    base: ForwardRun,
    offset: Float[np.ndarray, " data"],
    settings: RoomSettings,
    report: Event,
) -> tuple[Vector, ForwardRun]:
    """Parameters in prior deviations, zero but for heaters' coefficients, and the coarse room under them."""

    def climbed(n: int, way: float, vector: Vector, base: ForwardRun) -> tuple[Vector, ForwardRun]:
        for _ in range(_FARTHEST):
            moved = vector.copy()
            moved[n] += way
            where, flow = prior.parameters(moved), base.flow.last
            tried = march_under(coarse, where, flow, settings.restart_s, data.vertices, lambda _: None)
            left = misfit_ratio(data, tried, base, offset)
            report({prior.names()[n]: float(moved[n]), "misfit_left": left})
            if left >= 1.0:
                break
            vector, base = moved, tried
        return vector, base

    vector = np.zeros(len(prior.active()))
    for n, name in enumerate(prior.names()):
        if name.startswith("heater_log_heat"):
            vector, base = climbed(n, -1.0, vector, base)
            if vector[n] == 0.0:
                vector, base = climbed(n, 1.0, vector, base)
    return vector, base
