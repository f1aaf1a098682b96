"""T, p, u as unknowns on a staggered grid, with conservative discrete residuals."""

from core.grid.residuals import discrete_residuals
from core.grid.staggered import Staggered, StaggeredGrid

__all__ = ["Staggered", "StaggeredGrid", "discrete_residuals"]
