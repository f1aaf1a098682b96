"""A solution as VTK image data (VTI): evenly spaced vertices, T, p, vectors and what follows from them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from pyevtk.hl import imageToVTK

from app.experiment.results import to_dataset
from core.result import Derived, Solution

_NOT_OF_ONE_MOMENT = ("u", "v", "w", "T_departure")


def write_vti(
    path: Path,
    solution: Solution,
    derived: Sequence[Derived] = (),
    extra: Mapping[str, Float[np.ndarray, "nx ny nz"]] = {},
) -> None:
    """All that has one value a vertex as point data; of a sequence the mean. `extra` are more volumes by name."""
    dataset = to_dataset(replace(solution, temperature_shared_k=None), {}, derived)
    points: dict[str, Any] = {
        str(name): np.asfortranarray(dataset[name].to_numpy())
        for name in dataset.data_vars
        if name not in _NOT_OF_ONE_MOMENT
    }
    points |= {name: np.asfortranarray(values) for name, values in extra.items()}
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
