"""How often the 95 % intervals of draught, PMV, PPD, speed and age of the air hold rooms whose truth is known.

Each room is solved from computed shifts with misread entries, as `tests.benchmarks.coverage` does; then the figures
and maps are worked out of the result and of the truth. The figures of the truth's age have its own eddies where it
tells them (a large-eddy simulation does not: its mean flow leaves most of them out). One JSON line a room: the share
of inner points of each map whose true value is in its interval (a draught rate or a speed of nothing counts as held
where the interval begins at nothing), and of the table's figures those that are not held.

    python -m tests.benchmarks.indoor_coverage A.npz C.npz --cells 32 --coarse 21
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from app.bench.room_fit import problem_of
from app.reconstruct.problem import with_scene
from app.report.indoor import indoor
from app.report.maps import derived_maps
from app.volume.file import RoomVolume, read_volume
from app.volume.misread import misread
from app.volume.scene import RigOptions, room_scene
from app.volume.score import coverage, score_solution, truth_at
from core.comfort import CELSIUS_K
from core.metrics import inner
from core.occupied import OccupiedZone
from core.result import Solution
from core.scene import Inlet, Outlet, Scene
from core.solve.room import RoomSettings, solve_room
from core.ventilation.air_change import air_change, zone_share
from core.ventilation.face_flow import conserved, found_flow
from core.ventilation.openings import exchange, heat_capacity_j_m3_k, opening_patches
from core.ventilation.tracer import MOLECULAR_M2_S, TURBULENT_SCHMIDT, tracer

# A figure is held where the truth lies beyond its interval by less than the last digit that is told.
_DIGITS = 1e-3
# Cells an axis of the truth's age.
AGE_CELLS = 48


def of_the_truth(truth: RoomVolume, found: Solution) -> Solution:
    """The truth on the result's vertices, without deviations."""
    velocity = np.stack([truth_at(truth, found, truth.velocity_m_s[..., a]) for a in range(3)], axis=-1)
    kelvin = truth_at(truth, found, truth.temperature_k)
    return Solution(found.x_m, found.y_m, found.z_m, kelvin, velocity_m_s=velocity)


def _as_stated(true: Solution, truth: RoomVolume) -> dict[str, float]:
    """Of a truth that was computed: what its case states of supplies, and what leaves inside its outlets.

    Read off vertices, an opening that is two of them wide has a part of its wall's temperature.
    """
    scene = room_scene(truth, RigOptions(), "surveyed")
    parts = [part for part in scene.boundary if isinstance(part, Inlet | Outlet)]
    air = exchange(found_flow(true.filled(), opening_patches(scene)), true.temperature_k, scene)
    supplies = [(p.temperature_k, p.inward_m_s * p.patch.area_m2) for p in parts if isinstance(p, Inlet)]
    leaving = [
        (part.mean_temperature_k, max(-passage.inward_m3_s, 0.0))
        for part, passage in zip(parts, air.passages, strict=True)
        if isinstance(part, Outlet)
    ]
    (supply_k, flow_m3_s), (exhaust_k, _) = (
        (np.average(kelvin, weights=flows), sum(flows))
        for kelvin, flows in (np.array(openings, float).T for openings in (supplies, leaving))
    )
    return {
        "flow": 3600.0 * flow_m3_s,
        "supply_temperature": supply_k - CELSIUS_K,
        "exhaust_temperature": exhaust_k - CELSIUS_K,
        "heat": heat_capacity_j_m3_k(scene.air) * flow_m3_s * (supply_k - exhaust_k),
    }


def _aged(true: Solution, eddies_m2_s: np.ndarray, scene: Scene) -> dict[str, float]:
    """Figures of the age of a truth whose eddies' viscosity is known at its vertices."""
    flow = conserved(found_flow(true.filled(), opening_patches(scene)), AGE_CELLS)
    middles = np.meshgrid(*(0.5 * (axis[1:] + axis[:-1]) for axis in flow.axes_m), indexing="ij")
    between = RegularGridInterpolator((true.x_m, true.y_m, true.z_m), eddies_m2_s)
    eddies = between(np.stack(middles, axis=-1)) / TURBULENT_SCHMIDT
    change = air_change(tracer(flow, MOLECULAR_M2_S + eddies))
    return {
        "mean_age": change.mean_age_s / 60.0,
        "efficiency": 100.0 * change.efficiency,
        "zone_index": change.index(zone_share(change.flow, *OccupiedZone().box(scene.room))),
    }


def row_of(found: Solution, path: Path, scene: Scene) -> dict:
    """Shares of points held, and the table's figures that are not. `path` is the truth's."""
    truth = read_volume(path)
    true = of_the_truth(truth, found)
    true_maps = {one.name: one.values for one in derived_maps(true, scene)}
    held = {}
    for one in derived_maps(found, scene):
        if one.low is not None and one.high is not None:
            value, air = true_maps[one.name], np.isfinite(one.values)
            slack = _DIGITS * float(np.ptp(one.values[air]))
            there = (value >= one.low - slack) & (value <= one.high + slack)
            held[one.name] = float(np.mean(inner(there)[inner(air)]))
    real = {one.key: one.value for one in indoor(true, scene).quantities} | _as_stated(true, truth)
    with np.load(path) as kept:
        if "nut" in kept and "averaging_s" not in kept:
            real |= _aged(true, truth_at(truth, found, kept["nut"]), scene)
    table = [one for one in indoor(found, scene).quantities if one.low is not None and one.key in real]
    missed = {
        one.key: [real[one.key], one.low, one.high]
        for one in table
        if not one.low - _DIGITS * abs(one.value) <= real[one.key] <= one.high + _DIGITS * abs(one.value)
    }
    return {"held": held, "figures": len(table), "figures_missed": missed}


def main() -> None:
    """A row for every room and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path, nargs="+")
    parser.add_argument("--information", default="surveyed")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--cells", type=int, default=32)
    parser.add_argument("--coarse", type=int, default=21)
    options = parser.parse_args()
    settings = RoomSettings(cells=options.cells, coarse_cells=options.coarse)
    for path in options.truth:
        for seed in options.seeds:
            began_s = time.process_time()
            problem, truth = problem_of(path, options.information, "texture", "paper", seed)
            exact = problem.scene
            problem = with_scene(problem, misread(exact, seed))
            found = solve_room(problem, settings)
            row = {
                "truth": path.stem,
                "information": options.information,
                "seed": seed,
                "cells": options.cells,
            }
            row |= {"u_rel": score_solution(found, truth)["u"]["rel"], **coverage(found, truth)}
            row |= row_of(replace(found, history=()), path, exact)
            row["cpu_s"] = time.process_time() - began_s
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
