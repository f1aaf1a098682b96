"""`export`: a result for another program.

NetCDF (or HDF5), VTK image data, CSV, an OpenFOAM case, a picture, the surface of one temperature (PLY), paths of
particles (VTK), the bursts of a sequence (VTK's collection), or the report on two pages (PDF).
"""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal, get_args

from app.errors import BadInputError
from app.experiment.folder import open_experiment, read_manifest
from app.experiment.found import found_in
from app.experiment.results import read_derived, read_result, to_dataset
from app.files.durable import write_durably
from app.report.figures import as_png, slices_figure
from app.report.openfoam import write_openfoam
from app.report.paths import write_vtu
from app.report.series import write_series
from app.report.surface import write_ply
from app.report.volume_image import write_vti
from core.result import Derived, Solution

ExportFormat = Literal["nc", "h5", "vti", "csv", "zip", "png", "ply", "vtu", "pdf", "pvd"]


def export(
    folder: Path,
    kind: ExportFormat | None = None,
    output: Path | None = None,
    result: Path | None = None,
    level_k: float | None = None,
) -> Path:
    """Write the newest (or the given) result in another format and return the file. Raises BadInputError.

    Without a format it is the one that the output's name ends in; without either NetCDF.
    """
    experiment = open_experiment(folder)
    source = experiment.result(result) / "result.nc"
    if kind is None:
        kind = _named_by(output)
    # A collection is several files, packed.
    ending = "zip" if kind == "pvd" else kind
    named: dict[str, str] = {"pvd": "result-bursts", "pdf": "report"}
    path = output or source.with_name(f"{named.get(kind, 'result-export')}.{ending}")
    if path.suffix != f".{ending}":
        raise BadInputError(f"The output is {path.name}; expected a name that ends in .{ending}.")
    if level_k is not None and kind != "ply":
        raise BadInputError(
            f"A level was given for {kind}; only ply, the surface of one temperature, has one."
        )
    if kind in ("nc", "h5"):  # NetCDF-4 is HDF5
        write_durably(path, lambda temporary: shutil.copyfile(source, temporary))
    else:
        scene = experiment.settings.scene
        standing = [one.box for one in found_in(read_manifest(source.parent)) if one.solved]
        writers: dict[str, Callable[[Path, Solution], object]] = {
            "vti": partial(write_vti, derived=read_derived(source)),
            "csv": partial(_write_csv, derived=read_derived(source)),
            "zip": partial(write_openfoam, objects=(*scene.objects, *standing), air=scene.air),
            "png": _write_png,
            "vtu": write_vtu,
            "pvd": write_series,
        }
        writers["pdf"] = lambda temporary, _: _write_pdf(temporary, folder, source.parent)
        writers["ply"] = partial(write_ply, level_k=level_k)
        writer = writers[kind]
        solution = read_result(source)
        write_durably(path, lambda temporary: writer(temporary, solution))
    return path


def _named_by(output: Path | None) -> ExportFormat:
    """The format that a file's name ends in. Raises BadInputError."""
    if output is None:
        return "nc"
    ending = output.suffix.removeprefix(".")
    found = next((one for one in get_args(ExportFormat) if one == ending), None)
    if found is None:
        raise BadInputError(
            f"The output is {output.name}; expected a name that ends in one of "
            f"{', '.join(get_args(ExportFormat))}, or a format."
        )
    return found


def _write_csv(path: Path, solution: Solution, derived: Sequence[Derived] = ()) -> None:
    """One row a vertex; the header names quantity and unit."""
    dataset = to_dataset(replace(solution, departures=None, temperature_shared_k=None), {}, derived)
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
