"""What a scene states about a room as parameters, and how far each may be wrong.

Supply temperature and flow carry the operator's standard deviations, but at least 2 % of the contrast and
3 % of the flow, since nobody's model of a supply is better. Heat coefficients of walls are a guess: free
convection gives 1 to 3 W/m2K; where a thermometer tells what leaves, their common level follows from the
heat balance. An unknown wall has the nominal coefficient and a temperature of its own, since the air's
temperature is linear in it: that of the air is an adiabatic wall. What leaves says their mean.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float

from core.estimate.balance import (
    free_walls_k,
    heat_balance_m_s,
    supply_m3_s,
)
from core.geometry import WALLS
from core.known import leaving_excess_k, stated_walls, unknown_walls
from core.problem import Problem
from core.room.boundary_conditions import RoomLayout, RoomParameters, SuspectedHeater
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.scene import Heater, Inlet

# Walls' heat coefficients are right within a factor of two (one sigma 0.6 in the logarithm).
_WALL_HEAT_STD = 0.6
# Where walls' temperatures are free, their common coefficient is nearly the same degree of freedom.
_SHARED_HEAT_STD = 0.3
# Spread of unknown walls: of their distance from the air, and at least of the supply's contrast.
_WALL_SHARE, _LEAST_WALL_SHARE = 1.0, 0.2
_HEATER_HEAT_M_S, _HEATER_HEAT_STD = 2.5e-3, 0.6
# A viscosity that the images may choose absorbs every other misfit and spoils u: k-epsilon keeps its own.
_CLOSURE_STD, _SIMPLE_CLOSURE_STD = 0.12, 0.25
# One viscosity for all air is no room's: where nobody stated its value either, the images may choose it from place
# to place, within a factor of 4.5 (one sigma).
_GUESSED_VISCOSITY_STD = 1.5
_LEAST_SHARE_T, _LEAST_SHARE_U = 0.02, 0.03
# Where walls are unknown their temperatures and their common heat coefficient are much the same freedom.
WALL_PARAMETERS = ("wall_excess_k", "log_heat")
# Walls that a view looks through, and onto: where both are unknown they are fitted as one.
FITTED_AS_ONE = ("y_min", "y_max")
_NEAR, _FAR = (WALLS.index(name) for name in FITTED_AS_ONE)


class Prior(eqx.Module):
    """Mean and standard deviation of every parameter; a parameter of zero deviation is not fitted.

    Where walls' heat follows from the balance of the stated supply and a thermometer in what leaves
    (`leaving_excess_k`), another supply moves it along: the thermometer stays.
    """

    mean: RoomParameters
    std: RoomParameters
    supply_m3_s: Float[np.ndarray, " inlets"]
    leaving_excess_k: float | None = eqx.field(static=True)

    def active(self) -> np.ndarray:
        """Indices of the fitted parameters in the flattened vector."""
        std = self.std
        if self.front_and_back_tied():
            std = eqx.tree_at(lambda p: p.wall_excess_k, std, std.wall_excess_k.at[_FAR].set(0.0))
        return np.flatnonzero(np.asarray(ravel_pytree(std)[0]) > 0)

    def unknown_walls(self) -> list[str]:
        """Walls whose temperature is fitted."""
        spread_k = np.asarray(self.std.wall_excess_k)
        return [name for name, std_k in zip(WALLS, spread_k, strict=True) if std_k > 0]

    def front_and_back_tied(self) -> bool:
        """Whether the walls before and behind the air are fitted as one: rays through both report them not apart."""
        return set(FITTED_AS_ONE) <= set(self.unknown_walls())

    def parameters(self, vector: Float[np.ndarray, " active"]) -> RoomParameters:
        """Parameters from fitted ones in units of their deviations from the mean."""
        mean, restore = ravel_pytree(self.mean)
        std = np.asarray(ravel_pytree(self.std)[0], float)
        chosen = self.active()
        flat = np.asarray(mean, float).copy()
        flat[chosen] += vector * std[chosen]
        found = restore(jnp.asarray(flat, mean.dtype))
        if self.front_and_back_tied():
            walls = found.wall_excess_k.at[_FAR].set(found.wall_excess_k[_NEAR])
            found = eqx.tree_at(lambda p: p.wall_excess_k, found, walls)
        moved = found.wall_log_heat + self._balanced(found)
        return eqx.tree_at(lambda p: p.wall_log_heat, found, moved)

    def _balanced(self, found: RoomParameters) -> float:
        """Logarithm of what the supply brings over what it was stated to bring, beyond what leaves."""
        if self.leaving_excess_k is None:
            return 0.0
        flow = self.supply_m3_s * np.exp(np.asarray(found.inlet_log_flow, float))
        brought = float(np.dot(flow, np.asarray(found.inlet_excess_k, float) - self.leaving_excess_k))
        stated = float(
            np.dot(self.supply_m3_s, np.asarray(self.mean.inlet_excess_k, float) - self.leaving_excess_k)
        )
        return float(np.log(np.clip(brought / stated, 0.25, 4.0))) if brought * stated > 0 else 0.0

    def names(self) -> list[str]:
        """Names of the fitted parameters, such as 'inlet_excess_k[0]'."""
        named = []
        for path, leaf in jax.tree_util.tree_leaves_with_path(self.std):
            stem = jax.tree_util.keystr(path).lstrip(".")
            named += [f"{stem}[{n}]" if np.ndim(leaf) else stem for n in range(np.size(leaf))]
        return [named[n] for n in self.active()]

    def suspected(self) -> Bool[np.ndarray, " active"]:
        """Which fitted parameters are the heat of heaters that nobody stated: those without a coefficient."""
        bare = {f"heater_excess_k[{n}]" for n in np.flatnonzero(np.asarray(self.std.heater_log_heat) == 0)}
        return np.array([name in bare for name in self.names()], bool)

    def gaussian(self) -> Bool[np.ndarray, " active"]:
        """Which fitted parameters nobody entered, so that nobody did so wrongly: the closure, unknown walls.

        Where heat is suspected that nobody stated, nothing else is taken for wrong beside it.
        """
        suspected = self.suspected()
        if suspected.any():
            return ~suspected
        own = ("log_closure", "log_viscosity", *(WALL_PARAMETERS if self.unknown_walls() else ()))
        return np.array([name.startswith(own) for name in self.names()], bool)


def room_prior(
    problem: Problem, layout: RoomLayout, *, log_viscosity_std: float | None = None, wall_heat: float = 1.0
) -> Prior:
    """Parameters as stated, and their spread; `wall_heat` multiplies every wall's heat coefficient."""
    scene = problem.scene
    ambient = scene.air.ambient_temperature_k
    inlets = [b for b in scene.boundary if isinstance(b, Inlet)]
    heaters = [b for b in scene.boundary if isinstance(b, Heater)]
    walls = [stated_walls(scene)[name] for name in WALLS]
    excess = np.array([i.temperature_k - ambient for i in inlets])
    speed = np.array([float(np.linalg.norm(i.velocity_m_s)) for i in inlets])
    contrast = max([abs(e) for e in excess] + [abs(h.temperature_k - ambient) for h in heaters] + [0.1])
    wall_excess = np.array(
        [0.0 if w is None or w.temperature_k is None else w.temperature_k - ambient for w in walls]
    )
    free = np.isin(WALLS, unknown_walls(scene))
    balanced = None if free.any() else heat_balance_m_s(problem, layout, excess, wall_excess)
    heat_m_s = NOMINAL_HEAT_M_S if balanced is None else balanced
    own, apart_k = free_walls_k(problem, layout, excess, wall_excess)
    wall_excess = np.where(free, own, wall_excess)
    mean = RoomParameters(
        _f32(excess),
        jnp.zeros(len(inlets)),
        jnp.float32(np.log(wall_heat)),
        _f32(wall_excess),
        jnp.full(6, np.log(heat_m_s)),
        _f32([h.temperature_k - ambient for h in heaters]),
        jnp.full(len(heaters), np.log(_HEATER_HEAT_M_S)),
        jnp.float32(0.0),
        jnp.zeros((3, 3, 4)),
    )
    simple = scene.flow.transport in ("given", "zero_equation")
    if log_viscosity_std is None:
        guessed = scene.flow.transport == "given" and scene.flow.viscosity_m2_s is None
        log_viscosity_std = _GUESSED_VISCOSITY_STD if guessed else 0.0
    std = RoomParameters(
        _f32([max(i.temperature_std_k, _LEAST_SHARE_T * contrast) for i in inlets]),
        _f32([max(i.velocity_std_m_s / s, _LEAST_SHARE_U) for i, s in zip(inlets, speed, strict=True)]),
        jnp.float32((_SHARED_HEAT_STD if free.any() else _WALL_HEAT_STD) * float(layout.heated.any())),
        _f32(np.where(free, max(_WALL_SHARE * apart_k, _LEAST_WALL_SHARE * contrast), 0.0)),
        jnp.zeros(6),
        _f32([h.temperature_std_k for h in heaters]),
        _f32([_HEATER_HEAT_STD * (not isinstance(h, SuspectedHeater)) for h in heaters]),
        jnp.float32(_SIMPLE_CLOSURE_STD if simple else _CLOSURE_STD),
        jnp.full((3, 3, 4), log_viscosity_std),
    )
    leaving = None if balanced is None else leaving_excess_k(problem)
    return Prior(mean, std, supply_m3_s(layout), leaving)


def _f32(values: object) -> Float[Array, "..."]:
    return jnp.asarray(np.asarray(values, float), jnp.float32)
