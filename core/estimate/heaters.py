"""Heat coefficients of stated heaters, by a line search over forward runs.

The heat that a surface of stated temperature gives off is uncertain by a factor of four between tables and programs.
The plume above it is far from linear in it, so derivatives do not help: the coarse room is marched with less heat, or
with more, heater by heater, as long as the misfit with the data falls.
"""

import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import ForwardRun, RoomSettings, march_under
from core.estimate.marches import Marches
from core.estimate.observation import Observations
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import Vector, misfit_ratio
from core.estimate.prior import Prior
from core.room.forward import Room

# Most steps of one prior deviation (0.6 in the logarithm) up or down.
_MOST_STEPS = 2

_DOING = "march with heaters that give less, or more"


def heaters_by_march(
    coarse: Room,
    prior: Prior,
    data: Observations,
    base: ForwardRun,
    offset: Float[np.ndarray, " data"],
    settings: RoomSettings,
    marches: Marches,
) -> tuple[Vector, ForwardRun]:
    """The heaters' coefficients in prior deviations, all other parameters zero, and the coarse room under them."""

    def climbed(n: int, way: float, vector: Vector, base: ForwardRun) -> tuple[Vector, ForwardRun]:
        for _ in range(_MOST_STEPS):
            moved = vector.copy()
            moved[n] += way
            where, flow = prior.parameters(moved), base.flow.last
            seconds = settings.restart_s
            tried = march_under(coarse, where, flow, seconds, data.vertices, marches, doing=_DOING)
            left = misfit_ratio(data, tried, base, offset)
            marches.record({"doing": _DOING, "misfit_left": left, **by_name(prior, moved)})
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
