"""airlens bench world: what each nuisance of a real rig costs, turned on alone and then all together.

Everything goes through whole pictures and the product's own steps: simulate, reconstruct, score.
"""

import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from app.bench.parts.options import AsJson
from app.pipeline import reconstruct
from app.simulate.experiment import simulate
from app.simulate.worlds import LAB, RigWorld, one_by_one
from app.volume.scene import RIG_PLACES, RigName, RigOptions
from app.volume.score import score_experiment


def register(bench: typer.Typer) -> None:
    """Add `world`."""
    bench.command("world")(world)


def world(
    truth: Annotated[list[Path], typer.Option(help="Room volume (NPZ); may be given several times.")],
    preset: Annotated[str, typer.Option(help="The preset that reconstructs.")] = "draft",
    information: Annotated[Literal["paper", "operator", "surveyed"], typer.Option()] = "operator",
    light: Annotated[Literal["texture", "projector"], typer.Option()] = "texture",
    rig: Annotated[Literal["paper", "lab"], typer.Option(help="30.5 m, or a lab's 4 m.")] = "lab",
    camera_px: Annotated[int, typer.Option(help="Columns of the camera; rows are three quarters.")] = 2048,
    frames: Annotated[int, typer.Option(help="Frames in a burst.")] = 100,
    seeds: Annotated[int, typer.Option(help="Seeds 0 to this one, exclusive.")] = 1,
    only: Annotated[str, typer.Option(help="Only the case of this name.")] = "",
    as_json: AsJson = False,
) -> None:
    """T and u, and the share of points within their 95 % intervals, nuisance by nuisance."""
    for path in truth:
        for seed in range(seeds):
            for name, case in one_by_one(LAB).items():
                if only in ("", name):
                    row = {"truth": path.stem, "nuisance": name, "preset": preset, "light": light}
                    row |= {"rig": rig, "camera_px": camera_px, "frames": frames, "seed": seed}
                    row |= measured(
                        path, case, options_of(rig, light, camera_px, frames), information, preset, seed
                    )
                    typer.echo(json.dumps(row) if as_json else _sentence(row))


def options_of(
    rig: RigName, light: Literal["texture", "projector"], camera_px: int, frames: int
) -> RigOptions:
    """The rig of a case."""
    stand_off_m, baseline_m = RIG_PLACES[rig]
    return RigOptions(
        camera_px=(camera_px, camera_px * 3 // 4),
        light=light,
        frames=frames,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
    )


def measured(
    truth: Path,
    case: RigWorld,
    options: RigOptions,
    information: Literal["paper", "operator", "surveyed"],
    preset: str,
    seed: int,
) -> dict[str, Any]:
    """Simulate, reconstruct and score one case."""
    camera, options = case.camera(seed), replace(options, marks=case.marks)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "experiment"
        simulate(
            truth, folder, options, information, camera, misreads=case.misreads, bracketed=case.bracketed
        )
        began_s = time.process_time()
        found = reconstruct(folder, preset)
        scores = score_experiment(folder, truth)
    return {
        "information": information,
        "T_rms_k": scores["T"]["rms_K"],
        "T_inlet_plane_k": scores["T"]["trivial"].get("inlet_plane"),
        "u_rel": None if scores["u"] is None else scores["u"]["rel"],
        "T_within": scores["T_within"],
        "u_within": scores["u_within"],
        "cpu_s": round(time.process_time() - began_s, 1),
        "outcome": scores["outcome"],
        "notes": [*found.measurement.notes, *found.solution.notes],
    }


def _sentence(row: dict[str, Any]) -> str:
    speed = "" if row["u_rel"] is None else f", u {row['u_rel']:.3f} ({100 * row['u_within']:.0f} % within)"
    return (
        f"{row['truth']} {row['rig']} {row['light']} {row['preset']}, {row['nuisance']}: T {row['T_rms_k']:.3f} K "
        f"({100 * row['T_within']:.0f} % within){speed}"
    )
