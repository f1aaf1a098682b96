"""What a report shows: a result with the experiment and the pictures that it came from, in memory or read once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from app.experiment.captures import CapturePair, load_capture, mean_capture
from app.experiment.folder import Experiment, read_manifest
from app.experiment.results import read_result
from app.experiment.shift_files import read_shifts
from app.report.indoor import Indoor, indoor
from app.report.maps import derived_maps
from app.volume.file import RoomVolume, read_volume
from app.volume.score import score_solution
from core.problem import ShiftMeasurement
from core.result import Derived, Solution

Image = Float32[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class Finding:
    """A result and what it came from. `captures` and `shifts` are asked for where they are shown, and may fail."""

    experiment: Experiment
    name: str
    manifest: Mapping[str, Any]
    solution: Solution
    shifts: Callable[[], tuple[ShiftMeasurement, ...]]
    captures: Callable[[], CapturePair]

    @cached_property
    def truth(self) -> RoomVolume | None:
        """The room that a simulated rig looked at. Raises BadInputError."""
        path = self.experiment.truth
        return None if path is None else read_volume(path)

    @cached_property
    def scores(self) -> dict[str, Any] | None:
        """The project's yardstick, where there is a truth. Raises BadInputError."""
        return None if self.truth is None else score_solution(self.solution, self.truth)

    @cached_property
    def derived(self) -> tuple[Derived, ...]:
        """Maps of what follows from T and u."""
        return derived_maps(self.solution, self.experiment.settings.scene)

    @cached_property
    def indoor(self) -> Indoor:
        """What the air means for people and ventilation. Raises SettingError for a room without an occupied zone."""
        return indoor(self.solution, self.experiment.settings.scene)


def read_finding(experiment: Experiment, folder: Path) -> Finding:
    """A kept result. Raises BadInputError for a manifest or a result.nc that cannot be read."""
    manifest = read_manifest(folder)

    def captures() -> CapturePair:
        names = manifest["captures"]
        kept = experiment.captures_folder
        after = load_capture(kept / names["after"]) if "after" in names else None
        flow, bursts = mean_capture([kept / name for name in manifest.get("bursts") or [names["flow"]]])
        return CapturePair(load_capture(kept / names["reference"]), flow, after, bursts)

    solution = read_result(folder / "result.nc")
    return Finding(experiment, folder.name, manifest, solution, lambda: read_shifts(folder), captures)
