"""airlens bench openfoam: a room by airlens' own march and by OpenFOAM, both from rest on the same cells.

OpenFOAM's steady solver (buoyantBoussinesqSimpleFoam) with its standard k-epsilon and wall functions, second-order
upwind; ours is marched in time. Both start from still air. What differs beside the solver: OpenFOAM's openings are
whole faces of cells, and its held walls pass heat by a wall function where ours share a coefficient from the heat
balance. OpenFOAM's fields are read every 200 iterations: its error has a curve over its processor seconds.
"""

import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from app.bench.foam_case import SOLVER, read_field, write_case
from app.bench.room_cost import cost_row
from app.errors import BadInputError
from app.volume.file import RoomVolume, read_volume
from app.volume.scene import RigOptions, room_scene
from app.volume.score import score_solution
from core.result import Solution
from core.room.forward import closure_name, room
from core.scene import Scene

_DEBIAN = Path("/usr/share/openfoam")
# Iterations between two readings, and in all.
_EVERY, _MOST = 200, 2000


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command("openfoam")
    def openfoam(
        truth: Annotated[Path, typer.Option(help="Room volume (NPZ).")],
        cells: Annotated[list[int] | None, typer.Option(help="Grids; 32 by default.")] = None,
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """A room by airlens' own march and by OpenFOAM (where it is installed), both from rest on the same cells."""
        volume = read_volume(truth)
        for n in cells or [32]:
            for row in rows(volume, n):
                typer.echo(json.dumps(row) if as_json else _sentence(row))


def rows(volume: RoomVolume, cells: int) -> Iterable[dict[str, Any]]:
    """Ours, then OpenFOAM at each reading: processor seconds from rest, and u's error over its rms.

    Raises BadInputError where OpenFOAM is not installed, fails, or the room holds what this case cannot.
    """
    variables = environment()
    scene = room_scene(volume, RigOptions(), "surveyed")
    ours = cost_row(volume, cells, jacobian=False)
    yield {"by": "airlens", "cells": ours["cells"], "cpu_s": ours["run_cpu_s"], "u_rel": ours["u_rel"]}
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder)
        counts = room(scene, cells, closure_name(scene)).grid.cells
        write_case(case, scene, counts, _EVERY, _MOST)
        for command in (["blockMesh"], ["topoSet"], ["createPatch", "-overwrite"]):
            run_foam(command, case, variables)
        log = run_foam([SOLVER], case, variables)
        spent = {
            int(step): float(cpu_s)
            for step, cpu_s in re.findall(r"^Time = (\d+)$.*?^ExecutionTime = ([\d.]+) s", log, re.M | re.S)
        }
        for step in range(_EVERY, _MOST + 1, _EVERY):
            yield {
                "by": "OpenFOAM",
                "cells": "x".join(map(str, counts)),
                "iterations": step,
                "cpu_s": spent[step],
                "u_rel": _error(case / str(step), scene, counts, volume),
            }


def _error(folder: Path, scene: Scene, cells: tuple[int, int, int], volume: RoomVolume) -> float:
    """u's error over its rms, of the fields that OpenFOAM wrote; walls are given the nearest cells' values."""
    velocity, kelvin = (
        np.pad(read_field(folder / name, cells), [(1, 1)] * 3 + [(0, 0)], mode="edge") for name in ("U", "T")
    )
    axes = []
    for axis, n in enumerate(cells):
        low, high = scene.room.lower_m[axis], scene.room.upper_m[axis]
        middles = low + (np.arange(n) + 0.5) * (high - low) / n
        axes.append(np.array([low, *middles, high]))
    x_m, y_m, z_m = axes
    found = Solution(x_m, y_m, z_m, kelvin[..., 0], np.zeros(kelvin.shape[:3]), velocity)
    return float(score_solution(found, volume)["u"]["rel"])


def environment() -> dict[str, str]:
    """Variables for OpenFOAM's programs; Debian's package finds its own files only where they name its folder.

    Raises BadInputError where OpenFOAM is not installed.
    """
    if shutil.which(SOLVER) is None:
        raise BadInputError(
            f"OpenFOAM's {SOLVER} is not on the path. Install OpenFOAM (Debian: openfoam), or source its bashrc."
        )
    here = dict(os.environ)
    if "WM_PROJECT_DIR" not in here and _DEBIAN.exists():
        here["WM_PROJECT_DIR"] = str(_DEBIAN)
    return here


def run_foam(command: list[str], case: Path, variables: dict[str, str]) -> str:
    """What one of OpenFOAM's programs printed. Raises BadInputError where it fails."""
    done = subprocess.run(command, cwd=case, env=variables, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = "\n".join((done.stdout + done.stderr).strip().splitlines()[-12:])
        raise BadInputError(f"{command[0]} of OpenFOAM failed:\n{last}")
    return done.stdout


def _sentence(row: dict[str, Any]) -> str:
    after = f" after {row['iterations']} iterations" if "iterations" in row else ""
    return f"{row['by']}, {row['cells']} cells{after}: {row['cpu_s']:.1f} CPU s, u {row['u_rel']:.3f}"
