"""Whether the air that `draft` finds lies the wrong way up: warm below cold, as the air of no room stays for long."""

from collections.abc import Callable

import numpy as np

from core.shared_errors import broad
from core.significance import TO_ONE_SIDE
from core.solve.draft.temperature_system import System, Volume


def upside_down(temperature_k: Volume, system: System, solve: Callable[[Volume], Volume]) -> list[str]:
    """A sentence if the temperature falls with height by more than its deviation allows, in 19 rooms of 20.

    `solve` inverts the Hessian of `system`, in which the deviation is counted.
    """
    slope = broad(system.grid.shape)[1]
    rise_k = float(np.sum(slope * temperature_k))
    if rise_k >= 0.0:
        return []
    std_k = float(np.sqrt(np.sum(slope * solve(slope)))) / system.per_k
    if rise_k > -TO_ONE_SIDE * std_k:
        return []
    return [
        f"The air found is warmer below than above: it falls by {-rise_k:.2f} K from floor to ceiling "
        f"(deviation {std_k:.2f} K). Such air would turn over within minutes. Reference and flow may be swapped: "
        "check which picture was taken with the air moving."
    ]
