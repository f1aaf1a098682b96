"""A state as the sum of corrections on coarser grids: a multilevel preconditioner in the unknowns.

Gradient methods on a flat grid move smooth errors slowly. When each level, coarse to fine, holds a
correction and the state is their sum, one step moves every wavelength (Bramble, Pasciak, Xu 1990).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.grid.interpolation import on_axes_together
from core.grid.residuals import as_residuals, discrete_residuals
from core.grid.staggered import Staggered, StaggeredGrid
from core.losses.boussinesq import FlowValues, Numbers, Residuals
from core.losses.representation import Spans, positions


class MultiGrid(eqx.Module):
    """Corrections `levels`, coarse to fine, on `grids`; a representation of (T, p, u)."""

    levels: tuple[Staggered, ...]
    grids: tuple[StaggeredGrid, ...] = eqx.field(static=True)

    @property
    def finest(self) -> StaggeredGrid:
        """The grid of the state."""
        return self.grids[-1]

    def state(self) -> Staggered:
        """The sum of all levels on the finest grid."""
        total = self.levels[0]
        for coarse, fine, level in zip(self.grids[:-1], self.grids[1:], self.levels[1:], strict=True):
            total = jax.tree.map(jnp.add, prolong(total, coarse, fine), level)
        return total

    def fields(self) -> "GridFields":
        """T, p, u of the sum of all levels."""
        return GridFields(self.state(), self.finest)

    def refined(self, factor: int = 2) -> "MultiGrid":
        """The same state on one more level, which is zero."""
        old = self.finest
        cells = tuple(factor * n if n > 1 else 1 for n in old.cells)
        fine = StaggeredGrid(old.lower, old.upper, (cells[0], cells[1], cells[2]))
        return MultiGrid((*self.levels, fine.zeros()), (*self.grids, fine))


class GridFields(eqx.Module):
    """T, p, u of a staggered state: see `core.losses.representation.Fields`."""

    state: Staggered
    grid: StaggeredGrid

    def at(self, points_nd: Float[Array, "points 3"]) -> FlowValues:
        """T, p, u at scattered points, trilinear."""
        return self.grid.at(self.state, points_nd)

    def on_grid(self, spans: Spans) -> FlowValues:
        """T, p, u on a tensor grid of points, trilinear."""
        x, y, z = (positions(span) for span in spans)
        return self.grid.on_grid(self.state, (x, y, z))

    def residuals(self, numbers: Numbers, points_nd: Float[Array, "points 3"] | None) -> Residuals:
        """The discrete residuals of all cells and inner faces; `points_nd` is not used."""
        return as_residuals(discrete_residuals(self.state, self.grid, numbers))


def prolong(state: Staggered, coarse: StaggeredGrid, fine: StaggeredGrid) -> Staggered:
    """Linear interpolation of every unknown onto a finer grid."""
    return Staggered.of(on_axes_together(state.components, coarse.matrices(fine.axes)))


def zero_multigrid(grid: StaggeredGrid, *, coarsest: int = 4) -> MultiGrid:
    """All corrections zero: levels by halving `grid` until an axis would fall below `coarsest` cells."""
    cells = [grid.cells]
    while all(n == 1 or (n % 2 == 0 and n // 2 >= coarsest) for n in cells[0]):
        nx, ny, nz = (n if n == 1 else n // 2 for n in cells[0])
        cells.insert(0, (nx, ny, nz))
    grids = tuple(StaggeredGrid(grid.lower, grid.upper, shape) for shape in cells)
    return MultiGrid(tuple(g.zeros() for g in grids), grids)
