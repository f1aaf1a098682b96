"""The differentially heated square cavity (de Vahl Davis 1983), solved with the grid's residuals.

Free-fall scales: Re = sqrt(Ra / Pr), Pe = sqrt(Ra Pr), Ri = 1. Hot wall x = 0 at T = 1/2, cold wall x = 1 at
T = -1/2, insulated floor and ceiling, no slip. One cell thick along y; ghosts are set by the walls exactly.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.grid import Staggered, StaggeredGrid, discrete_residuals
from core.losses.boussinesq import Numbers
from core.solve.grid.gauss_newton import column_scale, gauss_newton_step

PRANDTL = 0.71
# Mean Nusselt numbers of the benchmark solution.
NUSSELT = {1e3: 1.118, 1e4: 2.243, 1e5: 4.519}

Plane = Float[Array, "_ _"]


class Cavity(eqx.Module):
    """The unknowns inside: T and p in cells, u on inner faces across x, w on inner faces across z."""

    temperature: Plane
    pressure: Plane
    u: Plane
    w: Plane

    def staggered(self) -> Staggered:
        """With walls and ghosts, and a direction y in which nothing changes."""
        t = jnp.pad(self.temperature, 1, mode="edge")
        t = t.at[0].set(1.0 - t[1]).at[-1].set(-1.0 - t[-2])
        u = jnp.pad(self.u, ((1, 1), (0, 0)))
        u = jnp.concatenate([-u[:, :1], u, -u[:, -1:]], axis=1)
        w = jnp.pad(self.w, ((0, 0), (1, 1)))
        w = jnp.concatenate([-w[:1], w, -w[-1:]], axis=0)
        n = self.temperature.shape[0]
        still = jnp.zeros((n + 2, 2, n + 2), t.dtype)
        thick = [jnp.repeat(a[:, None], 3, axis=1) for a in (t, u, w)]
        return Staggered(thick[0], self.pressure[:, None], (thick[1], still, thick[2]))


def numbers(rayleigh: float) -> Numbers:
    """Re, Pe, Ri of a Rayleigh number."""
    return Numbers(reynolds=(rayleigh / PRANDTL) ** 0.5, peclet=(rayleigh * PRANDTL) ** 0.5, richardson=1.0)


def at_rest(cells: int) -> Cavity:
    """Conduction only."""
    centres = (jnp.arange(float(cells)) + 0.5) / cells
    temperature = jnp.broadcast_to(0.5 - centres[:, None], (cells, cells))
    face = jnp.zeros((cells - 1, cells))
    return Cavity(temperature, jnp.zeros((cells, cells)), face, face.T)


def _rows(z: Cavity, data: tuple[StaggeredGrid, Array, Array]) -> tuple[Array, ...]:
    grid, reynolds, peclet = data
    of_the_air = Numbers(reynolds=reynolds, peclet=peclet, richardson=1.0)
    mass, momentum, heat = discrete_residuals(z.staggered(), grid, of_the_air)
    # The mean of p is free; a row fixes it.
    return mass, momentum[0], momentum[2], heat, z.pressure.mean()


def solve(cavity: Cavity, rayleigh: float, *, steps: int = 12, cg_iterations: int = 3000) -> Cavity:
    """Gauss-Newton until the residual stops falling."""
    n, given = cavity.temperature.shape[0], numbers(rayleigh)
    grid = StaggeredGrid((0.0, 0.0, 0.0), (1.0, 1.0 / n, 1.0), (n, 1, n))
    # As arrays: one program for all Rayleigh numbers.
    data = (grid, jnp.asarray(given.reynolds), jnp.asarray(given.peclet))
    damping = jnp.asarray(1e-6, cavity.temperature.dtype)
    for _ in range(steps):
        scale = column_scale(_rows, cavity, data)
        step = gauss_newton_step(_rows, cavity, data, damping, cg_iterations, 1e-4, scale=scale)
        if step is None or not float(step.cost_after) < float(step.cost_before):
            damping = damping * 100
            continue
        gained = 1 - float(step.cost_after / step.cost_before)
        cavity, damping = step.unknowns, jnp.maximum(damping / 10, 1e-10)
        if gained < 0.01 or float(step.cost_after) < 1e-10:
            break
    return cavity


@jax.jit
def mean_heat_flux(cavity: Cavity, peclet: float) -> Float[Array, ""]:
    """Mean over the cavity of Pe u T - dT/dx: the Nusselt number, by conservation on every plane."""
    state = cavity.staggered()
    t, u = state.temperature[:, 1, 1:-1], state.velocity[0][:, 1, 1:-1]
    slope = (t[1:] - t[:-1]) * cavity.temperature.shape[0]
    return (peclet * 0.5 * (t[1:] + t[:-1]) * u - slope).mean()


def nusselts(cells: int) -> dict[float, float]:
    """At each Rayleigh number of the benchmark, one starting from the other."""
    cavity, found = at_rest(cells), {}
    for rayleigh in NUSSELT:
        cavity = solve(cavity, rayleigh)
        found[rayleigh] = float(mean_heat_flux(cavity, numbers(rayleigh).peclet))
    return found
