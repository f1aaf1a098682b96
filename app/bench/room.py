"""airlens bench room: the room solver against published cavities, with what each cost.

Differentially heated square (de Vahl Davis 1983): mean Nusselt number, from two grids by Richardson's
extrapolation of second order. Lid-driven square (Ghia, Ghia and Shin 1982): the smallest u on the vertical
centre line. Both two-dimensional: two cells deep between free walls. Lid-driven cube at Re 1000: u on the cube's
centre line, half of the cube up to its plane of symmetry, at the points of Albensoeder and Kuhlmann's table 5
(Journal of Computational Physics 206, 2005, 536-558).
"""

import json
import time
from typing import Annotated

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from app.errors import AirlensError
from core.result import Outcome
from core.room.closure import ConstantClosure
from core.room.march import MarchSettings, march
from core.room.room_grid import RoomGrid
from core.room.step import RoomModel, air_at_rest, room_model
from core.room.wall_planes import Boundary, WallPlane, closed_room

PUBLISHED_NUSSELT = {1e4: 2.243, 1e5: 4.519, 1e6: 8.800}
PUBLISHED_LEAST_U = {100.0: -0.21090, 400.0: -0.32726, 1000.0: -0.38289}
# Height above the floor, u over the lid's speed.
PUBLISHED_CUBE = (
    (0.0547, -0.20623), (0.0625, -0.22283), (0.0703, -0.23696), (0.1016, -0.27293), (0.1719, -0.25160),
    (0.2813, -0.10999), (0.4531, -0.00612), (0.5000, 0.00802), (0.6172, 0.03905), (0.7344, 0.07334),
    (0.8516, 0.12183), (0.9531, 0.33171), (0.9609, 0.39821), (0.9688, 0.48443), (0.9766, 0.58964),
)  # fmt: skip
_CELLS = {1e4: 16, 1e5: 32, 1e6: 64, 100.0: 32, 400.0: 48, 1000.0: 64}
_PRANDTL = 0.71


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command()
    def room(
        fine: Annotated[int, typer.Option(help="Multiplies every grid's cells along an edge.")] = 1,
        cube: Annotated[bool, typer.Option(help="Only the lid-driven cube.")] = False,
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """Heated and lid-driven cavities against published values."""
        if cube:
            rows = [cube_row(32 * fine)]
        else:
            rows = [heated_row(ra, _CELLS[ra] * fine) for ra in PUBLISHED_NUSSELT]
            rows += [driven_row(re, _CELLS[re] * fine) for re in PUBLISHED_LEAST_U]
        for row in rows:
            typer.echo(json.dumps(row) if as_json else _sentence(row))


def heated_row(rayleigh: float, cells: int) -> dict[str, float | str]:
    """Nusselt number on `cells` and 3/2 of them, extrapolated."""
    start_s = time.process_time()
    coarse, fine = nusselt(rayleigh, cells), nusselt(rayleigh, cells * 3 // 2)
    found = fine + (fine - coarse) / ((3 / 2) ** 2 - 1)
    return _row("nusselt", rayleigh, cells * 3 // 2, found, PUBLISHED_NUSSELT[rayleigh], start_s)


def driven_row(reynolds: float, cells: int) -> dict[str, float | str]:
    """Smallest u on the centre line on `cells` and 3/2 of them, extrapolated."""
    start_s = time.process_time()
    coarse, fine = least_u(reynolds, cells), least_u(reynolds, cells * 3 // 2)
    found = fine + (fine - coarse) / ((3 / 2) ** 2 - 1)
    return _row("least u", reynolds, cells * 3 // 2, found, PUBLISHED_LEAST_U[reynolds], start_s)


def cube_row(cells: int) -> dict[str, float | str]:
    """The cube's lowest tabulated u at Re 1000 on `cells` and 3/2 of them, extrapolated; the whole line's error."""
    start_s = time.process_time()
    heights, published = np.array(PUBLISHED_CUBE).T
    coarse, fine = (_profile(centre_line(1000.0, n, n // 2), heights) for n in (cells, cells * 3 // 2))
    found = fine + (fine - coarse) / ((3 / 2) ** 2 - 1)
    lowest = int(published.argmin())
    row = _row("cube u", 1000.0, cells * 3 // 2, float(found[lowest]), float(published[lowest]), start_s)
    error = float(np.linalg.norm(found - published) / np.linalg.norm(published))
    return row | {"profile_error": error, "largest_difference": float(np.abs(found - published).max())}


def nusselt(rayleigh: float, cells: int) -> float:
    """Mean Nusselt number of the hot wall, in free-fall units (L = dT = g beta = 1)."""
    diffusivity = 1.0 / np.sqrt(rayleigh * _PRANDTL)

    def at(wall: WallPlane, excess_k: float) -> WallPlane:
        full = jnp.ones_like(wall.normal_m_s)
        return eqx.tree_at(
            lambda w: (w.conductance_m_s, w.wall_excess_k),
            wall,
            (full * (2.0 * cells * diffusivity), full * excess_k),
        )

    grid, bare = _square(cells)
    x, y, z = bare.walls
    boundary = Boundary(((at(x[0], 0.5), at(x[1], -0.5)), y, z))
    model = _model(grid, boundary, _PRANDTL * diffusivity, 1.0)
    profile = jnp.asarray(np.broadcast_to((0.5 - grid.centres_m(0))[:, None, None], grid.cells), jnp.float32)
    settings = MarchSettings(longest_s=120.0, tolerance=2e-4, level_ahead_s=0.0)
    end = march(air_at_rest(model, profile, 0.1), model, settings)
    return float(jnp.mean(0.5 - end.mean.excess_k[0])) * 2 * cells


def least_u(reynolds: float, cells: int) -> float:
    """Smallest u on a square's vertical centre line, in lid speeds; a parabola through the three lowest cells."""
    line = centre_line(reynolds, cells, 2)
    k = int(line.argmin())
    below, lowest, above = (float(line[i]) for i in (k - 1, k, k + 1))
    return lowest - (above - below) ** 2 / (8.0 * (above + below - 2.0 * lowest))


def centre_line(reynolds: float, cells: int, deep: int) -> Float[np.ndarray, " cells"]:
    """u in the cells of the vertical centre line, in lid speeds.

    Two cells deep is a square; half as deep as wide is half of a cube, its upper y wall the symmetry plane.
    """
    grid, bare = _square(cells) if deep == 2 else _half_cube(cells, deep)
    x, y, z = bare.walls
    lid = eqx.tree_at(lambda w: w.tangent_m_s[0], z[1], jnp.ones_like(z[1].normal_m_s))
    model = _model(grid, Boundary((x, y, (z[0], lid))), 1.0 / reynolds, 0.0)
    settings = MarchSettings(longest_s=100.0, tolerance=3e-4, level_ahead_s=0.0)
    end = march(air_at_rest(model, jnp.zeros(grid.cells), 0.1), model, settings)
    if end.outcome is Outcome.nonfinite:
        raise AirlensError(f"The cavity at Re {reynolds:g} on {cells} cells diverged: {end.outcome.value}")
    return np.asarray(end.last.velocity[0], np.float64)[cells // 2, -1]


def _profile(line: Float[np.ndarray, " cells"], heights: Float[np.ndarray, " points"]) -> np.ndarray:
    """The line at heights, by a spline through its cells, the still floor and the lid."""
    cells = (np.arange(len(line)) + 0.5) / len(line)
    whole = CubicSpline(np.concatenate([[0.0], cells, [1.0]]), np.concatenate([[0.0], line, [1.0]]))
    return whole(heights)


def _square(cells: int) -> tuple[RoomGrid, Boundary]:
    """A unit square in x and z, two cells deep between free walls."""
    edge = 1.0 / cells
    grid = RoomGrid(cells=(cells, 2, cells), lower_m=(0.0, 0.0, 0.0), spacing_m=(edge, edge, edge))
    x, y, z = closed_room(grid).walls
    low, high = (eqx.tree_at(lambda w: w.no_slip, wall, jnp.float32(0.0)) for wall in y)
    return grid, Boundary((x, (low, high), z))


def _half_cube(cells: int, deep: int) -> tuple[RoomGrid, Boundary]:
    """A unit cube from its wall y = 0 to its free plane of symmetry."""
    edge = 1.0 / cells
    grid = RoomGrid(cells=(cells, deep, cells), lower_m=(0.0, 0.0, 0.0), spacing_m=(edge, edge, edge))
    x, y, z = closed_room(grid).walls
    free = eqx.tree_at(lambda w: w.no_slip, y[1], jnp.float32(0.0))
    return grid, Boundary((x, (y[0], free), z))


def _model(grid: RoomGrid, boundary: Boundary, viscosity_m2_s: float, buoyancy: float) -> RoomModel:
    closure = ConstantClosure(jnp.float32(0.0), jnp.float32(viscosity_m2_s))
    return room_model(
        grid, boundary, closure, buoyancy_m_s2_k=buoyancy, molecular_m2_s=viscosity_m2_s, prandtl=_PRANDTL
    )


def _row(
    what: str, number: float, cells: int, found: float, published: float, start_s: float
) -> dict[str, float | str]:
    return {
        "what": what,
        "number": number,
        "cells": cells,
        "found": found,
        "published": published,
        "relative_error": found / published - 1.0,
        "cpu_s": time.process_time() - start_s,
    }


def _sentence(row: dict[str, float | str]) -> str:
    cost = f"{row['cpu_s']:.0f} CPU s"
    profile = f", whole line {100 * float(row['profile_error']):.1f} %" if "profile_error" in row else ""
    return (
        f"{row['what']:8s} at {row['number']:9.0f}, {row['cells']} cells: {row['found']:.4f}, "
        f"published {row['published']:.4f}, error {100 * float(row['relative_error']):+.2f} %{profile}, {cost}"
    )
