"""Rooms drawn at random, fitted as an operator would: how large the error is, and whether the result knows it.

One to three supplies of 0.05 to 1 m/s and -10 to +10 K, and an outlet, all on x_min; from number 101 on one or two
outlets, and all on any wall but the patterned one and the floor. Boxes of 2.4 to 8 m, walls adiabatic or of their own
temperature, and in half of the rooms a heated panel of the floor, which half of these operators state. The truth is
marched by `core.room` under k-epsilon with other constants, or under the zero-equation closure, on a finer grid; or
it is computed by OpenFOAM under k-epsilon, RNG k-epsilon or k-omega SST (`--by openfoam`). Entries are misread as far
as their deviations say. Rooms of even number are for choosing anything, those of odd number for figures; from 1000 on
they are for nobody to look at.

    python -m tests.benchmarks.random_rooms FOLDER --first 1 --rooms 12 [--cells 48] [--by openfoam]
        [--preset reference] [--views y,x] [--information surveyed] [--wrong 1.2]
    python -m tests.benchmarks.random_rooms FOLDER --summary [--preset reference] [--views y,x]
        [--information surveyed] [--wrong 1.2]
    python -m tests.benchmarks.random_rooms FOLDER --stated  # everything is known, nothing is fitted

`--cells` replaces the cells an edge of the preset's fine room.
With `--wrong` the supply that brings most air is entered so many times too fast, and too far from the ambient
temperature. Volumes and rows stay in FOLDER; a room that has its row by these options is not fitted again.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from app.bench.room_fit import mistaken, problem_of, scores_of, solved
from app.reconstruct.presets import REFERENCE, STANDARD
from app.reconstruct.problem import with_scene
from app.volume.file import read_volume
from app.volume.misread import misread
from app.volume.scene import Information, RigOptions, heater_of, parse_walls, room_scene
from core.estimate.prior import room_prior
from core.geometry import WallName
from core.metrics import inner, off_walls, rms
from core.problem import Problem
from core.room.forward import room, room_fields
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.room.march import MarchSettings, march
from core.scene import Inlet, Outlet
from tests.benchmarks.foam_rooms import MODELS, computed
from tests.benchmarks.indoor_coverage import row_of as indoor_row
from tests.benchmarks.other_rooms import T0_K, Made, marched

PRESETS = {"standard": STANDARD, "reference": REFERENCE}
_SEED = 2611
_NAMES = ("xMinWall", "xMaxWall", "front", "back", "floor", "ceiling")
# From this number on, openings stand on any wall but the patterned one and the floor.
_ON_ANY_WALL = 100
# Each wall, and its axes in the order of an opening's longer and shorter side; the ceiling twice, for it holds most.
_OPEN = (("xMinWall", "yz"), ("xMaxWall", "yz"), ("front", "xz"), ("ceiling", "xy"), ("ceiling", "yx"))
# Between two openings, and between an opening and the wall's edge.
_MARGIN_M = 0.1


def drawn(number: int) -> Made:
    """The room of this number."""
    draw = np.random.default_rng([_SEED, number])
    size = np.round([draw.uniform(2.4, 8.0), draw.uniform(2.4, 8.0), draw.uniform(2.4, 3.6)], 1)
    domain = (0.0, float(size[0]), -float(size[1]) / 2, float(size[1]) / 2, 0.0, float(size[2]))
    supplies, outlets = int(draw.integers(1, 4)), 1
    openings = _openings(draw, supplies + outlets, domain)
    if number >= _ON_ANY_WALL:
        outlets = int(draw.integers(1, 3))
        openings = _openings_anywhere(draw, supplies + outlets, domain)
    inlets = tuple(
        {
            **place,
            "U": round(float(np.exp(draw.uniform(np.log(0.05), 0.0))), 3),
            "dT": round(float(draw.uniform(-10.0, 10.0)), 2),
        }
        for place in openings[outlets:]
    )
    adiabatic = tuple(name for name in _NAMES if draw.random() < 0.4)
    supply_m3_s = sum(i["U"] * _area_m2(i) for i in inlets)
    walls = tuple((name, T0_K + round(float(2.0 * draw.standard_normal()), 2)) for name in _NAMES)
    return Made(
        domain=domain,
        vertices=tuple(int(n) for n in np.clip(np.round(size * 14), 40, 64)),  # type: ignore[arg-type]
        closure="k_epsilon" if draw.random() < 0.7 else "zero_equation",
        cells=44,
        title=f"room {number}, drawn at random",
        inlets=inlets,
        outlets=tuple(openings[:outlets]),
        heater=_heater(draw, domain) if draw.random() < 0.5 else None,
        wall_t=tuple(wall for wall in walls if wall[0] not in adiabatic),
        adiabatic=adiabatic,
        heat_factor=float(np.exp(0.3 * draw.standard_normal())),
        closure_factor=float(np.exp(0.25 * draw.standard_normal())),
        # An air change, within limits: after less the air's level still moves.
        settle_s=float(np.clip(np.prod(size) / supply_m3_s, 200.0, 1500.0)),
        refine_s=60.0,
    )


def _openings(draw: np.random.Generator, count: int, domain: tuple[float, ...]) -> list[dict[str, Any]]:
    """Rectangles of x_min that do not meet."""
    found: list[dict[str, Any]] = []
    while len(found) < count:
        width, height = draw.uniform(0.3, 1.2), draw.uniform(0.15, 0.5)
        y = draw.uniform(domain[2] + _MARGIN_M, domain[3] - _MARGIN_M - width)
        z = draw.uniform(_MARGIN_M, domain[5] - _MARGIN_M - height)
        new = {"y": [round(y, 2), round(y + width, 2)], "z": [round(z, 2), round(z + height, 2)]}
        if all(_apart(new, old, "y") or _apart(new, old, "z") for old in found):
            found.append(new)
    return found


def _openings_anywhere(
    draw: np.random.Generator, count: int, domain: tuple[float, ...]
) -> list[dict[str, Any]]:
    """Rectangles on any wall that may have one, the longer side along a wall's first axis, that do not meet."""
    bounds = dict(zip("xyz", (domain[:2], domain[2:4], domain[4:]), strict=True))
    found: list[dict[str, Any]] = []
    while len(found) < count:
        wall, along = _OPEN[draw.integers(len(_OPEN))]
        new: dict[str, Any] = {"wall": wall}
        for axis, sizes_m in zip(along, ((0.3, 1.2), (0.15, 0.5)), strict=True):
            low, high = bounds[axis]
            size_m = draw.uniform(*sizes_m)
            start_m = draw.uniform(low + _MARGIN_M, high - _MARGIN_M - size_m)
            new[axis] = [round(start_m, 2), round(start_m + size_m, 2)]
        beside = [old for old in found if old["wall"] == wall]
        if all(any(_apart(new, old, axis) for axis in along) for old in beside):
            found.append(new)
    return found


def _area_m2(box: dict[str, Any]) -> float:
    return float(np.prod([np.ptp(box[axis]) for axis in "xyz" if axis in box]))


def _apart(one: dict[str, Any], other: dict[str, Any], axis: str) -> bool:
    return one[axis][0] > other[axis][1] + _MARGIN_M or other[axis][0] > one[axis][1] + _MARGIN_M


def _heater(draw: np.random.Generator, domain: tuple[float, ...]) -> dict[str, Any]:
    side = draw.uniform(0.4, 1.0)
    x, y = (draw.uniform(low + 0.2, high - 0.2 - side) for low, high in (domain[:2], domain[2:4]))
    return {
        "x": [round(x, 2), round(x + side, 2)],
        "y": [round(y, 2), round(y + side, 2)],
        "dT": round(float(draw.uniform(15.0, 60.0)), 1),
    }


def made(folder: Path, number: int, by: str) -> Path:
    """The room's volume, computed if it is not there; a file of JSON beside it says how."""
    path, what = folder / f"room{number}.npz", drawn(number)
    if not path.exists():
        model = MODELS[number // 2 % len(MODELS)]
        arrays, row = computed(path.stem, what, model) if by == "openfoam" else marched(path.stem, what)
        path.with_suffix(".json").write_text(json.dumps(row))
        np.savez_compressed(path, **arrays)
    return path


def row_of(
    folder: Path,
    number: int,
    cells: int | None,
    by: str,
    preset: str,
    walls: tuple[WallName, ...],
    information: Information,
    wrong: float,
) -> dict[str, Any]:
    """Make the room if it is not there, fit it, and say how far off the result is and what it says of itself."""
    path, what = made(folder, number, by), drawn(number)
    problem, volume = problem_of(path, information, "texture", "paper", number, walls=walls)
    stated = what.heater is not None and (information == "surveyed" or number % 4 >= 2)
    # A surveyed room has its heater already.
    add = stated and information == "operator"
    exact = problem.scene
    problem = _entered(problem, number, heater_of(read_volume(path)) if add else None, wrong)
    settings = PRESETS[preset]
    solution, cpu_s = solved(problem, settings if cells is None else replace(settings, cells=cells))
    fit = scores_of(solution, cpu_s, volume)
    said = " ".join(fit["notes"])
    carried_k = inner(volume.temperature_k[:1] - volume.temperature_k)
    return {
        "room": number,
        "preset": preset,
        "views": walls,
        "information": information,
        "wrong": wrong,
        "closure": json.loads(path.with_suffix(".json").read_text())["closure"],
        "supplies": len(what.inlets),
        "heater": None if what.heater is None else ("stated" if stated else "not stated"),
        **fit,
        "carried_T_rms_k": rms(carried_k),
        "carried_T_air_rms_k": rms(off_walls(volume.temperature_k[:1] - volume.temperature_k)),
        "distrusts": "distrust the velocity" in said,
        "checks": "Check it" in said,
        **indoor_row(replace(solution, history=()), path, exact),
    }


def stated_row(folder: Path, number: int, cells: int | None, by: str) -> dict[str, Any]:
    """How far off a march is with everything stated as it is, under either closure, and nothing fitted.

    What OpenFOAM's outlets take is stated too, and its heaters give off heat by the wall function, as its walls do.
    What is left is the closure's, the grid's, and the truth's own, which may still move (`truth_moves`: how far the
    mean over its first half is from the mean over all, over its rms).
    """
    path, what = made(folder, number, by), drawn(number)
    cells = cells or STANDARD.cells
    volume, truth = read_volume(path), json.loads(path.with_suffix(".json").read_text())
    row = {"room": number, "truth": truth["closure"], "cells": cells, "truth_moves": truth.get("change_u")}
    scene = room_scene(volume, RigOptions(), "surveyed")
    if by == "openfoam":
        flows = iter(truth["outlets_m3_s"])
        parts = (
            replace(part, flow_m3_s=next(flows)) if isinstance(part, Outlet) else part
            for part in scene.boundary
        )
        scene = replace(scene, boundary=tuple(parts))
    for closure in ("k_epsilon", "zero_equation"):
        forward = room(scene, cells, closure)
        stated = room_prior(Problem(scene, (), ()), forward.layout).mean
        if by == "openfoam":
            by_wall_function = jnp.full_like(stated.heater_log_heat, np.log(NOMINAL_HEAT_M_S))
            stated = eqx.tree_at(lambda p: p.heater_log_heat, stated, by_wall_function)
        model = forward.model(stated)
        excess_k = 0.5 * float(np.mean([inlet["dT"] for inlet in what.inlets]))
        rest = forward.at_rest(model, np.full(forward.grid.cells[2], excess_k))
        found = march(rest, model, MarchSettings(longest_s=what.settle_s))
        field = room_fields(found.mean, model, forward.layout, what.vertices)
        u_m_s = inner(volume.velocity_m_s)
        off_k = inner(field.excess_k + volume.ambient_k - volume.temperature_k)
        row |= {
            f"u_rel_{closure}": rms(inner(field.velocity_m_s) - u_m_s) / rms(u_m_s),
            f"T_rms_k_{closure}": rms(off_k),
        }
    return row


def _entered(problem: Problem, number: int, heater: Any, wrong: float) -> Problem:
    """The problem as an operator enters it: the heater if it is stated, every entry misread, one supply wrong."""
    scene = problem.scene
    if heater is not None:
        scene = replace(scene, boundary=(*scene.boundary, heater))
    scene = misread(scene, number)
    inlets = [part for part in scene.boundary if isinstance(part, Inlet)]
    most = max(inlets, key=lambda inlet: inlet.inward_m_s * inlet.patch.area_m2, default=None)
    ambient_k = scene.air.ambient_temperature_k
    boundary = tuple(mistaken(most, wrong, ambient_k) if part is most else part for part in scene.boundary)
    return with_scene(problem, replace(scene, boundary=boundary))


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians, pooled and least coverage, and how often the results say the right thing of themselves."""
    u = np.array([row["u_rel"] for row in rows])
    distrusts = np.array([row["distrusts"] for row in rows])

    def share(of: np.ndarray) -> str:
        return f"{int(distrusts[of].sum())} of {int(of.sum())}"

    def over_carried(what: str) -> float:
        return float(np.median([row[f"{what}_rms_k"] / row[f"carried_{what}_rms_k"] for row in rows]))

    return {
        "rooms": len(rows),
        "u_median": float(np.median(u)),
        "T_over_carried_median": over_carried("T"),
        "T_air_over_carried_median": over_carried("T_air"),
        **{
            f"{name}_{what}": float(how([row[name] for row in rows]))
            for name in ("T_within", "u_within")
            for what, how in (("pooled", np.mean), ("least", np.min))
        },
        "distrusts_above_0.6": share(u > 0.6),
        "distrusts_below_0.3": share(u < 0.3),
        "checks": f"{sum(row['checks'] for row in rows)} of {len(rows)}",
        "cpu_s_median": float(np.median([row["cpu_s"] for row in rows])),
    }


def _how(row: dict[str, Any]) -> tuple[str, tuple[WallName, ...], Information, float]:
    """A row's preset, views and information, and how wrong a supply is entered."""
    return (
        row.get("preset", "standard"),
        tuple(row.get("views", ("y_max",))),
        row.get("information", "operator"),
        row.get("wrong", 1.0),
    )


def main() -> None:
    """Make, fit and tell rooms."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--rooms", type=int, default=12, help="every second one from --first")
    parser.add_argument(
        "--cells", type=int, help="an edge of the fine room; those of the preset unless given"
    )
    parser.add_argument("--by", choices=("airlens", "openfoam"), default="airlens")
    parser.add_argument("--preset", choices=PRESETS, default="standard")
    parser.add_argument("--views", default="y", help="the walls that are looked at, such as y,x")
    parser.add_argument("--information", choices=get_args(Information), default="operator")
    parser.add_argument("--wrong", type=float, default=1.0, help="multiplies the largest supply as entered")
    parser.add_argument("--stated", action="store_true", help="everything stated, nothing fitted")
    parser.add_argument("--summary", action="store_true")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    rows = options.folder / ("stated.jsonl" if options.stated else "rows.jsonl")
    walls = parse_walls(options.views)
    done = [json.loads(line) for line in rows.read_text().splitlines()] if rows.exists() else []
    asked = options.preset, walls, options.information, options.wrong
    done = [row for row in done if _how(row) == asked]
    if options.summary:
        print(json.dumps(summary([row for row in done if row["room"] % 2])))
        return
    for number in range(options.first, options.first + 2 * options.rooms, 2):
        if any(row["room"] == number for row in done):
            continue
        how = options.folder, number, options.cells, options.by
        row = stated_row(*how) if options.stated else row_of(*how, *asked)
        with rows.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
