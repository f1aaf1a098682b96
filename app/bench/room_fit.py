"""airlens bench room-fit: a marched room against its truth, by what is known, entered wrongly, and measured.

Shifts come from `synthetic_problem`. A camera of a quarter of the width and 256 times the frames carries
the default rig's information in as many windows, at a sixteenth of the rendering.
"""

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from app.reconstruct.problem import with_scene
from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import synthetic_problem
from app.volume.scene import RIG_PLACES, Information, RigName, RigOptions, parse_walls
from app.volume.score import coverage, score_solution
from core.geometry import WallName
from core.motion import MOTIONS, CameraMotion
from core.problem import Problem, ShiftMeasurement
from core.result import Solution
from core.scene import FlowModel, Inlet, Scene
from core.solve.room import RoomSettings, solve_room

_CAMERA_PX, _WINDOW_PX, _FRAMES = (1024, 768), 8, 100 * 16 * 16


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command("room-fit")
    def room_fit(
        truth: Annotated[list[Path], typer.Option(help="Room volume (NPZ); may be given several times.")],
        information: Annotated[Literal["paper", "operator", "surveyed"], typer.Option()] = "surveyed",
        light: Annotated[Literal["texture", "projector"], typer.Option()] = "texture",
        rig: Annotated[Literal["paper", "lab"], typer.Option()] = "paper",
        wrong: Annotated[float, typer.Option(help="Multiplies the supply's excess and velocity.")] = 1.0,
        wall_heat: Annotated[
            float,
            typer.Option(help="Multiplies the walls' heat coefficient as it follows from what is entered."),
        ] = 1.0,
        closure: Annotated[
            Literal["auto", "given", "zero_equation"], typer.Option(help="given: constant viscosity.")
        ] = "auto",
        drift_px: Annotated[
            float,
            typer.Option(
                help="Nothing is still, and the camera moved by so much (in its quarter-size pixels)."
            ),
        ] = 0.0,
        views: Annotated[
            str, typer.Option(help="Walls that are looked at, a camera before each: y_max,x_max; y is y_max.")
        ] = "y",
        images: Annotated[bool, typer.Option(help="Whether the images correct anything.")] = True,
        cells: Annotated[int, typer.Option(help="Cells of the fine room.")] = 48,
        seeds: Annotated[int, typer.Option(help="Noise seeds 0 to this one, exclusive.")] = 1,
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """Errors of T, u and p, and the share of points within their 95 % intervals."""
        walls = parse_walls(views)
        settings = RoomSettings(cells=cells, use_images=images, wall_heat=wall_heat)
        for path in truth:
            for seed in range(seeds):
                problem, volume = problem_of(path, information, light, rig, seed, drift_px, walls)
                problem = entered(problem, wrong, closure)
                row = {
                    "truth": path.stem,
                    "information": information,
                    "light": light,
                    "rig": rig,
                    "seed": seed,
                }
                row |= {
                    "views": walls,
                    "drift_px": drift_px,
                    "wrong": wrong,
                    "wall_heat": wall_heat,
                    "closure": closure,
                    "images": images,
                }
                row |= {"cells": cells} | scores_of(*solved(problem, settings), volume)
                typer.echo(json.dumps(row) if as_json else _sentence(row))


def problem_of(
    path: Path,
    information: Information,
    light: Literal["texture", "projector"],
    rig: RigName,
    seed: int,
    drift_px: float = 0.0,
    walls: tuple[WallName, ...] = ("y_max",),
) -> tuple[Problem, RoomVolume]:
    """The problem that the default rig makes of a volume, by views of `walls`; with `drift_px` cameras moved too."""
    volume = read_volume(path)
    stand_off_m, baseline_m = RIG_PLACES[rig]
    options = RigOptions(
        camera_px=_CAMERA_PX,
        frames=_FRAMES,
        light=light,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
        walls=walls,
    )
    problem = synthetic_problem(volume, options, information, window_px=_WINDOW_PX, seed=seed)
    return moved(problem, drift_px, seed) if drift_px else problem, volume


def moved(problem: Problem, drift_px: float, seed: int) -> Problem:
    """The problem after each camera moved, in each of its six ways, by a draw; known is its deviation alone."""

    def after(view: int, shift: ShiftMeasurement) -> ShiftMeasurement:
        motion = CameraMotion(problem.scene.views[view].camera, drift_px * np.eye(MOTIONS))
        draw = np.random.default_rng([seed, 77, view]).standard_normal(MOTIONS)
        step_px = motion.at(shift.centres_px) @ draw
        return replace(shift, displacement_px=shift.displacement_px + step_px, motion=motion)

    return replace(problem, shifts=tuple(after(n, shift) for n, shift in enumerate(problem.shifts)))


def entered(problem: Problem, wrong: float, closure: str) -> Problem:
    """The problem with its supply entered `wrong` times too strong and warm, and another closure."""
    scene = problem.scene
    ambient_k = scene.air.ambient_temperature_k
    boundary = tuple(
        mistaken(part, wrong, ambient_k) if isinstance(part, Inlet) else part for part in scene.boundary
    )
    flow = scene.flow if closure == "auto" else FlowModel(transport=closure)  # type: ignore[arg-type]
    changed: Scene = replace(scene, boundary=boundary, flow=flow)
    return with_scene(problem, changed)


def mistaken(inlet: Inlet, wrong: float, ambient_k: float) -> Inlet:
    """The inlet entered `wrong` times too fast and too far from the ambient temperature."""
    x, y, z = (wrong * v for v in inlet.velocity_m_s)
    temperature_k = ambient_k + wrong * (inlet.temperature_k - ambient_k)
    return replace(inlet, temperature_k=temperature_k, velocity_m_s=(x, y, z))


def solved(problem: Problem, settings: RoomSettings) -> tuple[Solution, float]:
    """The solution, and the processor seconds that it took."""
    began_s = time.process_time()
    solution = solve_room(problem, settings)
    return solution, time.process_time() - began_s


def scores_of(solution: Solution, cpu_s: float, volume: RoomVolume) -> dict[str, Any]:
    """Errors, coverage, what was found of the supplies, and what was said."""
    scores = score_solution(solution, volume)
    return {
        "u_rel": scores["u"]["rel"],
        "T_rms_k": scores["T"]["rms_K"],
        "T_air_rms_k": scores["T"]["air"]["rms_K"],
        "T_departure": scores["T"]["departure_of_departures"],
        "p_departure": scores["p"]["rel_departure"],
        **coverage(solution, volume),
        **{
            name: value
            for row in solution.history
            for name, value in row.items()
            if name.startswith("supply_")
        },
        "cpu_s": cpu_s,
        "wall_s": solution.solver_s,
        "outcome": solution.outcome.name,
        "notes": list(solution.notes),
    }


def _sentence(row: dict[str, Any]) -> str:
    return (
        f"{row['truth']} {row['information']} seed {row['seed']}: u {row['u_rel']:.3f}, T {row['T_rms_k']:.3f} K, "
        f"departure of T {row['T_departure']:.3f}, of p {row['p_departure']:.3f}; within 95 %: "
        f"T {row['T_within']:.3f}, u {row['u_within']:.3f}, p {row['p_within']:.3f}; {row['cpu_s']:.0f} CPU s, "
        f"{row['wall_s']:.0f} s ({row['outcome']})\n  " + "\n  ".join(row["notes"])
    )
