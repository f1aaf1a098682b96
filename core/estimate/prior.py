"""The prior: the room's parameters as stated, and their standard deviations.

Supply: the operator's values and deviations, but at least 2 % of the contrast and 3 % of the flow, since a supply's
model is no better than that. Walls of stated temperature: one heat coefficient, from the heat balance if the outflow
temperature is measured, else the nominal one of free convection (1 to 3 W/m2K). Unknown walls: the nominal
coefficient, and a temperature each, in which the air's temperature is linear. A wall at the temperature of the air is
adiabatic. The mean of the unknown temperatures comes from the heat balance.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float

from core.air import Air
from core.estimate.balance import (
    HEATER_HEAT_M_S,
    free_walls_k,
    heat_balance_m_s,
    supply_m3_s,
    walls_lose_k_m2,
)
from core.geometry import WALLS, WallName
from core.known import leaving_excess_k, stated_walls, unknown_walls
from core.problem import Problem
from core.room.boundary_conditions import RoomLayout, RoomParameters, SuspectedHeater
from core.room.forward import closure_name
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.scene import Heater, Inlet, Scene
from core.view_frame import passed_walls

# Walls' heat coefficients are known within a factor of two: one sigma is 0.6 in the logarithm.
_WALL_HEAT_STD = 0.6
# With unknown walls the common coefficient is nearly the same degree of freedom as their temperatures.
_SHARED_HEAT_STD = 0.3
# Deviation of an unknown wall's temperature: this share of its distance from the air, and at least that of the
# contrast. Whatever the supply, an outer wall of 0.5 W/m2K is 1.3 K from the air in 20 K of frost, by the surface
# resistance of ISO 6946 (0.13 m2K/W).
_WALL_SHARE, _LEAST_WALL_SHARE, _LEAST_WALL_K = 1.0, 0.2, 1.3
# One sigma of the logarithm of a heater's heat coefficient.
_HEATER_HEAT_STD = 0.6
# A freely fitted viscosity would absorb every other error and make the velocity worse: k-epsilon's is kept close.
_CLOSURE_STD, _SIMPLE_CLOSURE_STD = 0.12, 0.25
# No room has one viscosity everywhere. If one is asked for without a value, it is fitted as a coarse lattice, within
# a factor of 4.5 (one sigma).
_GUESSED_VISCOSITY_STD = 1.5
# Least deviations of a supply: of its temperature, as a share of the contrast, and of its flow.
_LEAST_SHARE_T, _LEAST_SHARE_U = 0.02, 0.03


class Prior(eqx.Module):
    """Mean and standard deviation of every parameter; a parameter of zero deviation is not fitted.

    If the walls' heat coefficient comes from the heat balance (`lost_k_m2` is not None, see `walls_lose_k_m2`), it
    follows the supply's parameters, so that the balance with the measured outflow temperature holds.
    """

    mean: RoomParameters
    std: RoomParameters
    supply_m3_s: Float[np.ndarray, " inlets"]
    leaving_excess_k: float = eqx.field(static=True)
    lost_k_m2: float | None = eqx.field(static=True)
    heat_capacity_j_m3_k: float = eqx.field(static=True, default=Air().heat_capacity_j_m3_k)
    # The walls that every camera looks through and onto, where all look along one axis.
    looked_through: tuple[WallName, WallName] | None = eqx.field(static=True, default=None)

    def active(self) -> np.ndarray:
        """Indices of the fitted parameters in the flattened vector."""
        std = self.std
        tied = self.tied()
        if tied:
            std = eqx.tree_at(
                lambda p: p.wall_excess_k, std, std.wall_excess_k.at[WALLS.index(tied[1])].set(0.0)
            )
        return np.flatnonzero(np.asarray(ravel_pytree(std)[0]) > 0)

    def unknown_walls(self) -> list[str]:
        """Walls whose temperature is fitted."""
        spread_k = np.asarray(self.std.wall_excess_k)
        return [name for name, std_k in zip(WALLS, spread_k, strict=True) if std_k > 0]

    def tied(self) -> tuple[WallName, WallName] | None:
        """Two unknown walls that are fitted as one: every ray passes both, so images see no difference."""
        through = self.looked_through
        return through if through and set(through) <= set(self.unknown_walls()) else None

    def parameters(self, vector: Float[np.ndarray, " active"]) -> RoomParameters:
        """All parameters for a vector of the fitted ones, which is in prior deviations from the mean."""
        mean, restore = ravel_pytree(self.mean)
        std = np.asarray(ravel_pytree(self.std)[0], float)
        chosen = self.active()
        flat = np.asarray(mean, float).copy()
        flat[chosen] += vector * std[chosen]
        found = restore(jnp.asarray(flat, mean.dtype))
        tied = self.tied()
        if tied:
            near, far = (WALLS.index(wall) for wall in tied)
            walls = found.wall_excess_k.at[far].set(found.wall_excess_k[near])
            found = eqx.tree_at(lambda p: p.wall_excess_k, found, walls)
        return self.balanced(found)

    def balanced(self, found: RoomParameters) -> RoomParameters:
        """These parameters with the walls' heat coefficient that closes their heat balance."""
        if self.lost_k_m2 is None:
            return found
        flow = self.supply_m3_s * np.exp(np.asarray(found.inlet_log_flow, float))
        brought = float(np.dot(flow, np.asarray(found.inlet_excess_k, float) - self.leaving_excess_k))
        brought += float(found.object_power_w.sum()) / self.heat_capacity_j_m3_k
        heat = jnp.full_like(found.wall_log_heat, np.log(heat_balance_m_s(brought, self.lost_k_m2)))
        return eqx.tree_at(lambda p: p.wall_log_heat, found, heat)

    def names(self) -> list[str]:
        """Names of the fitted parameters, such as 'inlet_excess_k[0]'."""
        named = []
        for path, leaf in jax.tree_util.tree_leaves_with_path(self.std):
            stem = jax.tree_util.keystr(path).lstrip(".")
            named += [f"{stem}[{n}]" if np.ndim(leaf) else stem for n in range(np.size(leaf))]
        return [named[n] for n in self.active()]

    def suspected(self) -> Bool[np.ndarray, " active"]:
        """Which fitted parameters are the heat of suspected heaters: those without a fitted coefficient."""
        bare = {f"heater_excess_k[{n}]" for n in np.flatnonzero(np.asarray(self.std.heater_log_heat) == 0)}
        return np.array([name in bare for name in self.names()], bool)

    def gaussian(self) -> Bool[np.ndarray, " active"]:
        """Which fitted parameters have a Gaussian prior: those that nobody entered (closure, unknown walls).

        If a heater is suspected, its heat alone has a Student's prior, and everything else a Gaussian one.
        """
        suspected = self.suspected()
        if suspected.any():
            return ~suspected
        walls = ("wall_excess_k", "log_heat") if self.unknown_walls() else ()
        own = ("log_closure", "log_viscosity", *walls)
        return np.array([name.startswith(own) for name in self.names()], bool)


def room_prior(
    problem: Problem, layout: RoomLayout, closure: str | None = None, *, wall_heat: float = 1.0
) -> Prior:
    """The prior of a problem under a closure, or the scene's.

    `wall_heat` multiplies the walls' heat coefficient.
    """
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
    lost = None if free.any() else walls_lose_k_m2(problem, layout, excess, wall_excess)
    own, apart_k = free_walls_k(problem, layout, excess, wall_excess)
    wall_excess = np.where(free, own, wall_excess)
    mean = RoomParameters(
        _f32(excess),
        jnp.zeros(len(inlets)),
        jnp.float32(np.log(wall_heat)),
        _f32(wall_excess),
        jnp.full(6, np.log(NOMINAL_HEAT_M_S)),
        _f32([h.temperature_k - ambient for h in heaters]),
        jnp.full(len(heaters), np.log(HEATER_HEAT_M_S)),
        jnp.float32(0.0),
        jnp.zeros((3, 3, 4)),
        *object_means(scene),
    )
    closure = closure or closure_name(scene)
    guessed = closure == "constant" and scene.flow.viscosity_m2_s is None
    std = RoomParameters(
        _f32([max(i.temperature_std_k, _LEAST_SHARE_T * contrast) for i in inlets]),
        _f32([max(i.velocity_std_m_s / s, _LEAST_SHARE_U) for i, s in zip(inlets, speed, strict=True)]),
        jnp.float32((_SHARED_HEAT_STD if free.any() else _WALL_HEAT_STD) * float(layout.heated.any())),
        _f32(np.where(free, max(_WALL_SHARE * apart_k, _LEAST_WALL_SHARE * contrast, _LEAST_WALL_K), 0.0)),
        jnp.zeros(6),
        _f32([h.temperature_std_k for h in heaters]),
        _f32([_HEATER_HEAT_STD * (not isinstance(h, SuspectedHeater)) for h in heaters]),
        jnp.float32({"k_epsilon": _CLOSURE_STD, "molecular": 0.0}.get(closure, _SIMPLE_CLOSURE_STD)),
        jnp.full((3, 3, 4), _GUESSED_VISCOSITY_STD * guessed),
        *object_deviations(scene),
    )
    prior = Prior(
        mean,
        std,
        supply_m3_s(layout),
        leaving_excess_k(problem) or 0.0,
        lost,
        scene.air.heat_capacity_j_m3_k,
        looked_through(scene),
    )
    return eqx.tree_at(lambda p: p.mean, prior, prior.balanced(mean))


def looked_through(scene: Scene) -> tuple[WallName, WallName] | None:
    """The two walls that every ray passes; None where cameras look along several axes, or one stands in the room."""
    first, *others = (passed_walls(view, scene.room) for view in scene.views)
    both = first.intersection(*others)
    if len(both) < 2:
        return None
    low, high = sorted(both, key=WALLS.index)
    return low, high


def object_means(scene: Scene) -> tuple[Array, Array, Array]:
    """Power [W], excess temperature [K] and logarithm of the heat coefficient of every object, as stated."""
    ambient = scene.air.ambient_temperature_k
    return (
        _f32([item.power_w or 0.0 for item in scene.objects]),
        _f32([(item.temperature_k or ambient) - ambient for item in scene.objects]),
        _f32([np.log(HEATER_HEAT_M_S) for _ in scene.objects]),
    )


def object_deviations(scene: Scene) -> tuple[Array, Array, Array]:
    """Their deviations; 0 for what an object does not state."""
    held = [float(item.thermal == "temperature") for item in scene.objects]
    return (
        _f32([item.power_std_w * (item.thermal == "power") for item in scene.objects]),
        _f32([item.temperature_std_k * h for item, h in zip(scene.objects, held, strict=True)]),
        _f32([_HEATER_HEAT_STD * h for h in held]),
    )


def _f32(values: object) -> Float[Array, "..."]:
    return jnp.asarray(np.asarray(values, float), jnp.float32)
