"""`export`: a result for another program.

NetCDF (or HDF5), VTK image data, CSV, an OpenFOAM case, a picture, the surface of one temperature (PLY), paths of
particles (VTK), or the report on two pages (PDF).
"""

import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pyevtk.hl import imageToVTK

from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.experiment.results import read_derived, read_result, to_dataset
from app.files.durable import write_durably
from app.report.figures import as_png, slices_figure
from app.report.openfoam import write_openfoam
from app.report.paths import write_vtu
from app.report.surface import write_ply
from core.result import Derived, Solution

ExportFormat = Literal["nc", "h5", "vti", "csv", "zip", "png", "ply", "vtu", "pdf"]


def export(
    folder: Path,
    kind: ExportFormat,
    output: Path | None = None,
    result: Path | None = None,
    level_k: float | None = None,
) -> Path:
    """Write the newest (or the given) result in another format and return the file. Raises BadInputError."""
    experiment = open_experiment(folder)
    source = (result or experiment.latest_result()) / "result.nc"
    path = output or source.with_name(f"result-export.{kind}")
    if path.suffix != f".{kind}":
        raise BadInputError(f"The output is {path.name}; expected a name that ends in .{kind}.")
    if level_k is not None and kind != "ply":
        raise BadInputError(
            f"A level was given for {kind}; only ply, the surface of one temperature, has one."
        )
    if kind in ("nc", "h5"):  # NetCDF-4 is HDF5
        write_durably(path, lambda temporary: shutil.copyfile(source, temporary))
    else:
        scene = experiment.settings.scene
        writers: dict[str, Callable[[Path, Solution], object]] = {
            "vti": partial(_write_vti, derived=read_derived(source)),
            "csv": partial(_write_csv, derived=read_derived(source)),
            "zip": partial(write_openfoam, objects=scene.objects, air=scene.air),
            "png": _write_png,
            "vtu": write_vtu,
        }
        writers["pdf"] = lambda temporary, _: _write_pdf(temporary, folder, source.parent)
        writers["ply"] = partial(write_ply, level_k=level_k)
        writer = writers[kind]
        solution = read_result(source)
        write_durably(path, lambda temporary: writer(temporary, solution))
    return path


def _write_vti(path: Path, solution: Solution, derived: Sequence[Derived] = ()) -> None:
    """VTK image data (XML): evenly spaced vertices, T, p, vectors and what follows from them as point data."""
    dataset = to_dataset(solution, {}, derived)
    points: dict[str, Any] = {
        str(name): np.asfortranarray(dataset[name].to_numpy())
        for name in dataset.data_vars
        if name not in ("u", "v", "w")
    }
    if "u" in dataset:
        components = [np.asfortranarray(dataset[name].to_numpy()) for name in ("u", "v", "w")]
        points["velocity"] = (components[0], components[1], components[2])
    axes = (solution.x_m, solution.y_m, solution.z_m)
    imageToVTK(
        str(path.with_suffix("")),
        origin=tuple(float(axis[0]) for axis in axes),
        spacing=tuple(float((axis[-1] - axis[0]) / (len(axis) - 1)) for axis in axes),
        pointData=points,
    )


def _write_csv(path: Path, solution: Solution, derived: Sequence[Derived] = ()) -> None:
    """One row a vertex; the header names quantity and unit."""
    dataset = to_dataset(solution, {}, derived)
    table = dataset.to_dataframe().reset_index()
    table.columns = [f"{name} [{dataset[name].attrs['units']}]" for name in table.columns]
    table.to_csv(path, index=False, float_format="%.9g")


def _write_pdf(path: Path, folder: Path, result: Path) -> None:
    """The report on two pages."""
    # Imported here: the other formats need none of the array library behind it.
    from app.report.pdf import report_pdf

    report_pdf(folder, result, path)


def _write_png(path: Path, solution: Solution) -> None:
    """The middle planes of the temperature, with arrows where velocity is known."""
    path.write_bytes(as_png(slices_figure(solution)))
