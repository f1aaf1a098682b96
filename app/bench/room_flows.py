"""airlens bench room-flows: the room solver's closures against measured turbulent flows, with what each cost.

Plane jet: its half-width grows by 0.100 to 0.110 of the distance (Rodi 1975; Pope, Turbulent Flows, 2000, section
5.4). Half of it above a free plane of symmetry; air enters evenly through the ceiling, as much as the jet entrains.
Tall cavity: air between a hot and a cold wall 76 mm apart, 2.18 m high, 19.6 K (Betts and Bokhari, International
Journal of Heat and Fluid Flow 21, 2000, 675-683; profiles of ERCOFTAC case 79 at half height, Ra 0.86e6).
"""

import json
import time
from typing import Annotated, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Float

from core.room.closure import AbstractClosure, KEpsilonClosure, ZeroEquationClosure, wall_distance_m
from core.room.k_epsilon import C_MU, NOMINAL_HEAT_M_S
from core.room.march import MarchSettings, march
from core.room.room_grid import RoomGrid
from core.room.step import Flow, RoomModel, air_at_rest, room_model
from core.room.wall_planes import Boundary, WallPlane, closed_room

Closure = Literal["k_epsilon", "zero_equation"]
CLOSURES: tuple[Closure, ...] = ("k_epsilon", "zero_equation")

MEASURED_GROWTH = (0.100, 0.110)
_JET_LENGTH, _JET_HEIGHT = 60.0, 40.0
# Volume flow of half a jet at its end: 0.44 sqrt(2 x) / 2 slot widths and speeds (Rajaratnam 1976).
_JET_END_FLOW = 2.4
_FITTED = (15.0, 35.0)

_CAVITY_M, _COLD_K, _CONTRAST_K = (0.076, 2.18), 288.15, 19.6
_AIR, _PRANDTL = 1.55e-5, 0.71
# x [mm] and mean vertical velocity [m/s] at half height.
_MEASURED_W = (
    (1.2, -0.081), (2.2, -0.115), (3.2, -0.124), (4.2, -0.133), (6.2, -0.135), (8.2, -0.134), (10.2, -0.120),
    (12.2, -0.112), (14.2, -0.110), (16.2, -0.100), (18.2, -0.089), (23.2, -0.062), (28.2, -0.048),
    (33.2, -0.011), (38.2, 0.012), (43.2, 0.041), (48.2, 0.054), (53.2, 0.077), (58.2, 0.091), (60.2, 0.099),
    (62.2, 0.106), (64.2, 0.120), (66.2, 0.127), (68.2, 0.133), (70.2, 0.137), (71.2, 0.140), (72.2, 0.131),
    (73.2, 0.121),
)  # fmt: skip
# x [mm] and mean temperature [degrees Celsius] at half height.
_MEASURED_T = (
    (0.58, 15.94), (1.09, 16.78), (2.11, 18.48), (3.25, 19.43), (5.15, 20.46), (7.69, 21.74), (10.23, 22.21),
    (12.77, 22.74), (17.85, 23.35), (22.93, 23.69), (28.01, 24.25), (33.09, 25.15), (38.17, 25.26),
    (43.11, 25.57), (48.19, 26.12), (53.27, 26.30), (58.35, 26.99), (63.43, 27.53), (67.24, 27.71),
    (69.78, 28.61), (71.05, 29.44), (72.95, 30.50), (74.09, 31.66), (75.11, 33.08), (75.62, 33.94),
)  # fmt: skip


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command("room-flows")
    def room_flows(
        case: Annotated[Literal["jet", "tall", "both"], typer.Option()] = "both",
        fine: Annotated[float, typer.Option(help="Multiplies every grid's cells along an edge.")] = 1.0,
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """A plane jet's spreading rate and a tall heated cavity's profiles against measurements."""
        rows = [jet_row(fine)] if case != "tall" else []
        rows += [tall_row(name, fine) for name in CLOSURES if case != "jet"]
        for row in rows:
            typer.echo(json.dumps(row) if as_json else _sentence(row))


def jet_row(fine: float) -> dict[str, float | str]:
    """Growth of a plane jet's half-width with distance under k-epsilon; slot width and speed 1, Re 1e5."""
    start_s = time.process_time()
    per_slot = 2 * round(3 * fine)
    cells = (round(_JET_LENGTH * per_slot), 2, round(_JET_HEIGHT * per_slot))
    edge = 1.0 / per_slot
    grid = RoomGrid(cells=cells, lower_m=(0.0, 0.0, 0.0), spacing_m=(edge, edge, edge))
    model = _model(grid, _jet_walls(grid, per_slot // 2), _closure("k_epsilon", grid, 1e-5), 0.0, 1e-5)
    settings = MarchSettings(longest_s=600.0, window_s=40.0, tolerance=0.004, level_ahead_s=0.0)
    end = march(air_at_rest(model, jnp.zeros(cells), 0.3), model, settings)
    u = np.asarray(end.mean.velocity[0], np.float64).mean(1)
    where = (grid.faces_m(0) > _FITTED[0]) & (grid.faces_m(0) < _FITTED[1])
    widths = [_half_width(line, grid.centres_m(2)) for line in u[where]]
    growth = float(np.polyfit(grid.faces_m(0)[where], widths, 1)[0])
    return {
        "what": "plane jet",
        "closure": "k_epsilon",
        "cells": "x".join(map(str, cells)),
        "growth": growth,
        "measured_low": MEASURED_GROWTH[0],
        "measured_high": MEASURED_GROWTH[1],
        "centre_speed_at_30": float(u[round(30 * per_slot), 0]),
        "change": end.change,
        "outcome": end.outcome.name,
        "cpu_s": time.process_time() - start_s,
    }


def tall_row(closure: Closure, fine: float) -> dict[str, float | str]:
    """Errors of the mean profiles at half height: T over the walls' contrast, w over its measured peak."""
    start_s = time.process_time()
    cells = (round(24 * fine), 2, round(160 * fine))
    (width, height), deep = _CAVITY_M, _CAVITY_M[0] / 24
    grid = RoomGrid(
        cells=cells, lower_m=(0.0, 0.0, 0.0), spacing_m=(width / cells[0], deep, height / cells[2])
    )
    model = _model(
        grid,
        _tall_walls(grid, closure),
        _closure(closure, grid, _AIR),
        9.81 / (_COLD_K + _CONTRAST_K / 2),
        _AIR,
    )
    profile = _CONTRAST_K * grid.centres_m(0)[:, None, None] / width
    start = jnp.asarray(np.broadcast_to(profile, cells), jnp.float32)
    settings = MarchSettings(longest_s=240.0, window_s=20.0, tolerance=0.004, level_ahead_s=0.0)
    end = march(air_at_rest(model, start, 0.14), model, settings)
    t_error, w_error, peak_error = _profile_errors(end.mean, grid)
    return {
        "what": "tall cavity",
        "closure": closure,
        "cells": "x".join(map(str, cells)),
        "T_profile": t_error,
        "w_profile": w_error,
        "w_peak": peak_error,
        "change": end.change,
        "outcome": end.outcome.name,
        "cpu_s": time.process_time() - start_s,
    }


def _profile_errors(mean: Flow, grid: RoomGrid) -> tuple[float, float, float]:
    """Rms errors at half height of T and w, and the relative error of the mean of w's two peaks."""
    middle = grid.cells[2] // 2
    w = np.asarray(mean.velocity[2], np.float64)[:, :, middle].mean(1)
    excess = np.asarray(mean.excess_k, np.float64)[:, :, middle - 1 : middle + 1].mean((1, 2))
    x = np.concatenate([[0.0], grid.centres_m(0), [_CAVITY_M[0]]])
    places, speeds = np.array(_MEASURED_W).T
    points, celsius = np.array(_MEASURED_T).T
    found_w = np.interp(places * 1e-3, x, np.concatenate([[0.0], w, [0.0]]))
    found_k = np.interp(points * 1e-3, x, np.concatenate([[0.0], excess, [_CONTRAST_K]]))
    measured_k = celsius + 273.15 - _COLD_K
    peak = 0.5 * (speeds.max() - speeds.min())
    return (
        float(np.sqrt(np.mean((found_k - measured_k) ** 2)) / _CONTRAST_K),
        float(np.sqrt(np.mean((found_w - speeds) ** 2)) / peak),
        float(0.5 * (w.max() - w.min()) / peak - 1.0),
    )


def _half_width(line: Float[np.ndarray, " nz"], heights: Float[np.ndarray, " nz"]) -> float:
    """Where the speed falls to half of the plane of symmetry's."""
    level = 0.5 * line[0]
    k = int(np.argmax(line < level))
    return float(
        heights[k - 1] + (line[k - 1] - level) / (line[k - 1] - line[k]) * (heights[k] - heights[k - 1])
    )


def _jet_walls(grid: RoomGrid, slot_cells: int) -> Boundary:
    """The slot low on x_min, a free floor, an even inflow from above, and a way out low on x_max."""
    x, y, z = closed_room(grid).walls
    nz = grid.cells[2]
    out_cells = nz // 5
    slot = jnp.zeros(grid.plane(0)).at[:, :slot_cells].set(1.0)
    entrained = (_JET_END_FLOW - 0.5) / _JET_LENGTH
    flow = 0.5 + entrained * _JET_LENGTH
    way_out = jnp.zeros(grid.plane(0)).at[:, :out_cells].set(flow / (out_cells * grid.spacing_m[2]))
    # 5 % of turbulence, mixing length 0.07 slot widths.
    k = 1.5 * 0.05**2
    low = eqx.tree_at(
        lambda w: (w.normal_m_s, w.turbulent_energy_m2_s2, w.dissipation_m2_s3),
        x[0],
        (slot, slot * k, slot * C_MU**0.75 * k**1.5 / 0.07),
    )
    high = eqx.tree_at(lambda w: w.normal_m_s, x[1], way_out)
    top = jnp.full(grid.plane(2), -entrained)
    quiet = jnp.full(grid.plane(2), 1e-6)
    above = eqx.tree_at(
        lambda w: (w.normal_m_s, w.turbulent_energy_m2_s2, w.dissipation_m2_s3),
        z[1],
        (top, quiet, quiet * 1e-3),
    )
    front, back = (_free(wall) for wall in y)
    return Boundary(((low, high), (front, back), (_free(z[0]), above)))


def _tall_walls(grid: RoomGrid, closure: Closure) -> Boundary:
    """Cold x_min, hot x_max, the rest adiabatic; conduction through half a cell where no wall function says more."""
    x, y, z = closed_room(grid).walls
    conductance = NOMINAL_HEAT_M_S if closure == "k_epsilon" else _AIR / _PRANDTL / (0.5 * grid.spacing_m[0])

    def at(wall: WallPlane, excess_k: float) -> WallPlane:
        full = jnp.ones_like(wall.normal_m_s)
        return eqx.tree_at(
            lambda w: (w.conductance_m_s, w.wall_excess_k), wall, (full * conductance, full * excess_k)
        )

    front, back = (_free(wall) for wall in y)
    return Boundary(((at(x[0], 0.0), at(x[1], _CONTRAST_K)), (front, back), z))


def _free(wall: WallPlane) -> WallPlane:
    return eqx.tree_at(lambda w: w.no_slip, wall, jnp.float32(0.0))


def _closure(name: Closure, grid: RoomGrid, molecular_m2_s: float) -> AbstractClosure:
    one, molecular = jnp.float32(1.0), jnp.float32(molecular_m2_s)
    if name == "k_epsilon":
        return KEpsilonClosure(one, molecular)
    # Nothing is near in y, where the walls are free.
    width, _, height = grid.spacing_m
    deep = RoomGrid(cells=grid.cells, lower_m=grid.lower_m, spacing_m=(width, 1e3, height))
    return ZeroEquationClosure(wall_distance_m(deep), one, molecular)


def _model(
    grid: RoomGrid, boundary: Boundary, closure: AbstractClosure, buoyancy: float, molecular_m2_s: float
) -> RoomModel:
    return room_model(
        grid, boundary, closure, buoyancy_m_s2_k=buoyancy, molecular_m2_s=molecular_m2_s, prandtl=_PRANDTL
    )


def _sentence(row: dict[str, float | str]) -> str:
    if row["what"] == "plane jet":
        said = (
            f"half-width grows by {float(row['growth']):.3f} of the distance, measured "
            f"{row['measured_low']:.3f} to {row['measured_high']:.3f}"
        )
    else:
        said = (
            f"T {100 * float(row['T_profile']):.1f} % of the contrast, w {100 * float(row['w_profile']):.0f} % of "
            f"its peak (rms of the profiles); the peak {100 * float(row['w_peak']):+.0f} %"
        )
    cost = f"{float(row['cpu_s']):.0f} CPU s, {row['outcome']}"
    return f"{row['what']}, {row['closure']}, {row['cells']} cells: {said}; {cost}"
