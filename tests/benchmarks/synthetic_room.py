"""A room whose truth is the grid's own steady solution, walls known: how fast the optimiser gets there.

The truth is marched in time with the very residuals that the reconstruction drives to zero, so this is
the speed of an optimiser, not tomography. One JSON line: CPU seconds apart from compilation, and errors.
"""

import argparse
import json
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from core.air import Air
from core.geometry import Box, looking_along_y
from core.grid import Staggered, StaggeredGrid, discrete_residuals
from core.grid.multiresolution import prolong
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.rays.operator import build
from core.scene import FixedTexture, FlowModel, PlaneField, Scene, View, Wall
from core.solve.grid.grid import GridSettings, solve_grid
from core.solve.nondimensional import RoomFrame, frame_of
from core.solve.regime import DataModel
from tests.benchmarks.options import whole_numbers

INLET, OUTLET = ((0.35, 0.65), (0.65, 0.85)), ((0.35, 0.65), (0.05, 0.25))


def room_scene(reynolds: float) -> Scene:
    """A cube of 3 m; jet of 0.5 m/s, 2.5 K warm; cold sides, insulated floor and ceiling."""
    air = Air()
    cold = air.ambient_temperature_k
    sides = [Wall(wall=w, thermal="temperature", temperature_k=cold) for w in ("x_max", "y_min", "y_max")]
    camera = looking_along_y(position_m=(1.5, -27.0, 1.5), width_px=512, height_px=512, focal_px=5000.0)
    viscosity = 0.5 * 3.0 / reynolds
    return Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 3.0)),
        air=air,
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(
            PlaneField(file="plane"),
            *sides,
            Wall(wall="z_min", thermal="adiabatic"),
            Wall(wall="z_max", thermal="adiabatic"),
        ),
        flow=FlowModel(transport="given", viscosity_m2_s=viscosity, diffusivity_m2_s=1.25 * viscosity),
    )


def settled(grid: StaggeredGrid, frame: RoomFrame, steps: int) -> Staggered:
    """The steady state; from that of half the cells where there are more than 32, which takes fewer steps."""
    if grid.cells[0] <= 32:
        return march(grid, frame, grid.zeros(), steps)
    coarse = StaggeredGrid(grid.lower, grid.upper, tuple(n // 2 for n in grid.cells))
    return march(grid, frame, prolong(settled(coarse, frame, steps), coarse, grid), steps // 2)


def march(grid: StaggeredGrid, frame: RoomFrame, start: Staggered, steps: int) -> Staggered:
    """The steady state by artificial compressibility: velocity and T from the residuals, then pressure."""
    n = grid.cells[0]
    centres = (np.arange(n) + 0.5) / n
    y, z = np.meshgrid(centres, centres, indexing="ij")
    holes = [
        ((y > a[0]) & (y < a[1]) & (z > b[0]) & (z < b[1])).astype(np.float32) for a, b in (INLET, OUTLET)
    ]
    flux = jnp.asarray(holes[0] - holes[1] * holes[0].sum() / holes[1].sum())
    inlet = jnp.asarray(holes[0]) > 0
    inner, step = (slice(1, -1),) * 3, 0.1 / n

    @jax.jit
    def advance(state: Staggered) -> Staggered:
        def once(_, state):
            _, momentum, heat = discrete_residuals(state, grid, frame.numbers)
            velocity = tuple(
                v.at[inner].add(-step * m) for v, m in zip(state.velocity, momentum, strict=True)
            )
            temperature = state.temperature.at[inner].add(-step * heat)
            state = _walls(Staggered(temperature, state.pressure, velocity), flux, inlet)
            mass = discrete_residuals(state, grid, frame.numbers)[0]
            return Staggered(state.temperature, state.pressure - 4.0 * step * mass, state.velocity)

        return jax.lax.fori_loop(0, steps, once, state)

    return advance(_walls(start, flux, inlet))


def _walls(state: Staggered, flux: jax.Array, inlet: jax.Array) -> Staggered:
    """Ghosts of no-slip walls, cold sides, insulated floor and ceiling, inlet and outlet."""
    t = state.temperature
    t = t.at[:, :, 0].set(t[:, :, 1]).at[:, :, -1].set(t[:, :, -2])
    t = t.at[-1].set(-t[-2]).at[:, 0].set(-t[:, 1]).at[:, -1].set(-t[:, -2])
    first = t[1, 1:-1, 1:-1]
    t = t.at[0, 1:-1, 1:-1].set(jnp.where(inlet, 2.0 - first, first))
    velocity = []
    for own in range(3):
        v = state.velocity[own]
        for axis in range(3):
            v = jnp.moveaxis(v, axis, 0)
            v = v.at[0].set(0.0 if axis == own else -v[1]).at[-1].set(0.0 if axis == own else -v[-2])
            v = jnp.moveaxis(v, 0, axis)
        velocity.append(v)
    velocity[0] = velocity[0].at[0, 1:-1, 1:-1].set(flux)
    return Staggered(t, state.pressure, (velocity[0], velocity[1], velocity[2]))


def synthetic_problem(cells: int, reynolds: float, steps: int) -> tuple[Problem, Staggered, StaggeredGrid]:
    """The marched truth and what is measured of it: plane x_min, walls, shifts with 3e-4 px of noise."""
    scene = room_scene(reynolds)
    axis_m = np.linspace(0.0, 3.0, 2 * cells + 1)
    # Scales come from the plane's largest values: 1 before the truth is known.
    shape = (len(axis_m), len(axis_m))
    bare = PlaneData(
        "x_min",
        axis_m,
        axis_m,
        np.full(shape, scene.air.ambient_temperature_k + 2.5),
        np.zeros(shape),
        np.full((*shape, 3), 0.5 / np.sqrt(3)),
    )
    frame = frame_of(Problem(scene, (), (bare,)))
    grid = StaggeredGrid(frame.lower, frame.upper, (cells,) * 3)
    truth = settled(grid, frame, steps)
    plane = grid.on_grid(truth, (np.zeros(1), axis_m / 3, axis_m / 3))
    t_k, p, u = frame.scales.to_si(plane)
    known = PlaneData(
        "x_min",
        axis_m,
        axis_m,
        *(np.asarray(a[0], np.float64) for a in (t_k, p, u)),
    )
    n = cells + 1
    operator = build(scene, 0, _centres(), (n, n, n), window_px=8.0)
    vertices = grid.on_grid(truth, (np.linspace(0, 1, n),) * 3)
    excess = scene.air.excess_refractivity(frame.scales.excess_k * vertices.temperature)
    exact = np.asarray(jax.jit(lambda o, e: o.apply(e))(operator, excess), np.float64)
    noise = 3e-4 * np.random.default_rng(0).standard_normal(exact.shape)
    information = np.broadcast_to(np.eye(2) / 3e-4**2, (len(exact), 2, 2)).copy()
    return (
        Problem(scene, (ShiftMeasurement(_centres(), exact + noise, information, 8),), (known,)),
        truth,
        grid,
    )


def _centres() -> np.ndarray:
    row, column = np.meshgrid(np.arange(3.5, 512, 8), np.arange(3.5, 512, 8), indexing="ij")
    return np.stack([column.ravel(), row.ravel()], axis=1)


def errors(found, truth: Staggered, grid: StaggeredGrid, frame: RoomFrame) -> dict[str, float]:
    """Relative errors of T - T0 and u over the vertices of the result."""
    axes = tuple(
        (a - low) / frame.scales.length_m
        for a, low in zip((found.x_m, found.y_m, found.z_m), frame.room.lower_m, strict=True)
    )
    t_k, _, u = frame.scales.to_si(grid.on_grid(truth, axes))
    excess = np.asarray(t_k) - frame.scales.reference_k
    return {
        "t_error": float(np.linalg.norm(found.temperature_k - t_k) / np.linalg.norm(excess)),
        "u_error": float(np.linalg.norm(found.velocity_m_s - u) / np.linalg.norm(u)),
    }


def main() -> None:
    """Solve once to compile and once to measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    whole_numbers(parser, cells=32, march_steps=8000, coarsest=16, steps=3, cg_iterations=60)
    parser.add_argument("--reynolds", type=float, default=100.0)
    options = parser.parse_args()
    problem, truth, grid = synthetic_problem(options.cells, options.reynolds, options.march_steps)
    left = discrete_residuals(truth, grid, frame_of(problem).numbers)
    settings = GridSettings(
        cells=options.cells,
        coarsest=options.coarsest,
        steps_a_level=options.steps,
        cg_iterations=options.cg_iterations,
        data=DataModel(representation=0.0),
    )
    for kind in ("first, with compilation", "second"):
        began = time.process_time()
        found = solve_grid(problem, settings)
        cpu_s = time.process_time() - began
        line = {"run": kind, "cells": options.cells, "cpu_s": round(cpu_s, 2)}
        line |= {"solver_s": round(found.solver_s, 2), "outcome": found.outcome.name}
        line |= {k: round(v, 5) for k, v in errors(found, truth, grid, frame_of(problem)).items()}
        line["truth_residual"] = float(
            max(jnp.abs(a).max() for a in jax.tree.leaves(eqx.filter(left, eqx.is_array)))
        )
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
