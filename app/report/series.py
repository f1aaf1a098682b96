"""A sequence for ParaView: a collection (PVD) that names one volume (VTI) a burst, in one zip file."""

import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from pyevtk.vtk import VtkGroup

from app.errors import BadInputError
from app.report.volume_image import write_vti
from core.result import Solution

COLLECTION = "bursts"


def write_series(path: Path, solution: Solution) -> None:
    """T in every burst, its deviation and its departure from the mean; u is the mean's. Raises BadInputError."""
    found = solution.departures
    if found is None:
        raise BadInputError(
            "The result has no bursts. Take a sequence and reconstruct it: airlens reconstruct EXPERIMENT --sequence"
        )
    mean_std_k = solution.temperature_std_k
    own_std_k = found.temperature_std_k
    std_k = own_std_k if mean_std_k is None else np.hypot(mean_std_k, own_std_k)
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        group = VtkGroup(str(Path(folder) / COLLECTION))
        for number, (time_s, departure_k) in enumerate(zip(found.time_s, found.temperature_k, strict=True)):
            one = Path(folder) / f"burst-{number:04d}.vti"
            burst = replace(
                solution,
                temperature_k=solution.temperature_k + departure_k,
                temperature_std_k=std_k,
                departures=None,
            )
            write_vti(one, burst, extra={"T_departure": departure_k})
            group.addFile(str(one), sim_time=float(time_s))
            packed.write(one, one.name)
        group.save()
        packed.write(Path(folder) / f"{COLLECTION}.pvd", f"{COLLECTION}.pvd")
