"""The level of T, found by a heat balance of horizontal layers instead of by marching on.

Jets become steady in under a minute; the level of T takes a quarter of an hour. The heat equation is linear in T.
Summed over horizontal layers it is a small matrix A: the exchange between layers (flow both ways, diffusion) and with
walls and outlets. A room that still warms at the rate r will warm by about A^-1 r. This is one coarse Newton step,
the aggregation of algebraic multigrid; its fixed point is the steady state, where r = 0.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from core.room.room_grid import AXES, Cells, cut, face_mean
from core.room.step import Flow, RoomModel


def level_correction(
    flow: Flow, warming_k_s: Cells, model: RoomModel, ahead_s: Float[Array, ""]
) -> Float[Array, " nz"]:
    """What to add to the temperature of each layer [K] of a room that warms by `warming_k_s`.

    The uniform part is added whole. Differences between layers, which internal waves disturb, are added as far as
    they would grow in `ahead_s` (implicit Euler).
    """
    exchange = layer_exchange_m3_s(flow, model)
    volume = model.grid.volume_m3
    source = warming_k_s.sum((0, 1)) * volume
    lost = exchange.sum(1)
    # A room that loses no heat has no steady level: a loss of one air change an hour keeps this finite.
    leak = volume * warming_k_s.size / 3600.0
    uniform = source.sum() / (lost.sum() + leak)
    layer_m3 = volume * warming_k_s.shape[0] * warming_k_s.shape[1]
    implicit = exchange + jnp.eye(exchange.shape[0]) * (layer_m3 / ahead_s)
    return uniform + jnp.linalg.solve(implicit, source - lost * uniform)


def layer_exchange_m3_s(flow: Flow, model: RoomModel) -> Float[Array, "nz nz"]:
    """The matrix A: heat that leaves each layer per kelvin of every layer, over rho c."""
    grid = model.grid
    inner = cut(flow.velocity[2], 1, -1, 2)
    diffusive = face_mean(model.diffusivity_m2_s(model.viscosity(flow)), 2) / grid.spacing_m[2]
    if model.boundary.solids is not None:
        diffusive = diffusive * cut(model.boundary.solids.open_faces[2], 1, -1, 2)
    area = grid.face_area_m2(2)
    up = (jnp.maximum(inner, 0.0) + diffusive).sum((0, 1)) * area
    down = (jnp.maximum(-inner, 0.0) + diffusive).sum((0, 1)) * area
    nothing = jnp.zeros(1)
    own = jnp.concatenate([up, nothing]) + jnp.concatenate([nothing, down]) + _lost_m3_s(flow, model)
    return jnp.diag(own) - jnp.diag(up, -1) - jnp.diag(down, 1)


def _lost_m3_s(flow: Flow, model: RoomModel) -> Float[Array, " nz"]:
    """Outflow and wall conductance of each layer."""
    grid = model.grid
    lost = jnp.zeros(grid.cells[2])
    factors = model.closure.wall_heat(flow.turbulence, grid)
    for a in AXES:
        area = grid.face_area_m2(a)
        for side, wall in enumerate(model.boundary.walls[a]):
            outward = jnp.maximum(-wall.normal_m_s if side == 0 else wall.normal_m_s, 0.0)
            leaving = (outward + factors[a][side] * wall.conductance_m_s) * area
            if a == 2:
                lost = lost.at[0 if side == 0 else -1].add(leaving.sum())
            else:
                lost = lost + leaving.sum(0)
    solids = model.boundary.solids
    if solids is not None:
        taken = (
            model.closure.object_heat(flow.turbulence, solids) * solids.heat.conductance_m_s * solids.area_m2
        )
        lost = lost + solids.added(jnp.zeros(grid.cells), taken).sum((0, 1))
    return lost
