"""How far a supply's jet reaches, and how much it falls or rises on its way.

The jet is followed from plane to plane away from its wall: at the fastest place near where it was. Its throw ends
where it is slower than a terminal speed there; its drop is how much lower it is at that place than at the opening.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.geometry import face_of
from core.result import Solution
from core.scene import Inlet
from core.setting import SettingError

# ISO 5219 and ASHRAE 70: the speed up to which a throw is told.
TERMINAL_M_S = 0.25


class Jet(eqx.Module):
    """Throw [m], whether it ended before the wall opposite, and drop [m], negative where the jet rises.

    A jet from a floor or a ceiling has no drop: it is NaN.
    """

    throw_m: float
    ended: bool
    drop_m: float


def supply_jet(solution: Solution, inlet: Inlet, terminal_m_s: float = TERMINAL_M_S) -> Jet:
    """The jet of one supply in the found velocity. Raises SettingError for a solution without velocity."""
    if solution.velocity_m_s is None:
        raise SettingError("This result has no velocity. Solve with a preset that finds it: standard.")
    face = face_of(inlet.patch.wall)
    turned = slice(None, None, -1) if face.upper else slice(None)
    axis_m = (solution.x_m, solution.y_m, solution.z_m)[face.axis]
    away_m = np.abs(axis_m - axis_m[face.end])[turned]
    # The last plane is the wall opposite, where every jet stands still.
    speed_m_s, place_m = _followed(solution, solution.velocity_m_s, inlet, turned)
    slow = np.flatnonzero(speed_m_s[:-1] < terminal_m_s)
    last = int(slow[0]) if len(slow) else len(away_m) - 1
    throw_m = float(away_m[last])
    if len(slow) and last > 0:
        faster, slower = speed_m_s[last - 1], speed_m_s[last]
        throw_m -= float(away_m[last] - away_m[last - 1]) * float((terminal_m_s - slower) / (faster - slower))
    fall_m = float(place_m[0, 1] - place_m[max(last - 1, 0), 1])
    return Jet(throw_m, bool(len(slow)), float("nan") if face.axis == 2 else fall_m)


def _followed(
    solution: Solution, velocity_m_s: Float[np.ndarray, "_ _ _ 3"], inlet: Inlet, turned: slice
) -> tuple[Float[np.ndarray, " planes"], Float[np.ndarray, "planes 2"]]:
    """Greatest speed near the jet in each plane, and where it is along the wall's two axes."""
    face = face_of(inlet.patch.wall)
    along = [(solution.x_m, solution.y_m, solution.z_m)[a] for a in face.along]
    spans = list(zip(inlet.patch.lower_m, inlet.patch.upper_m, strict=True))
    at_m = [0.5 * (low + high) for low, high in spans]
    reach_m = [max(0.5 * max(high - low for low, high in spans), 1.01 * float(a[1] - a[0])) for a in along]
    speeds, places = [], []
    for plane in np.moveaxis(np.linalg.norm(velocity_m_s, axis=-1), face.axis, 0)[turned]:
        near = [np.abs(a - at) <= reach for a, at, reach in zip(along, at_m, reach_m, strict=True)]
        speed = np.where(np.outer(*near), plane, 0.0)
        i, j = np.unravel_index(int(np.argmax(speed)), speed.shape)
        if places:  # the opening itself is where it is stated
            at_m = [float(along[0][i]), float(along[1][j])]
        speeds.append(float(speed[i, j]))
        places.append(at_m)
    return np.array(speeds), np.array(places)
