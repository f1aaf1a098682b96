"""The story on one screen: load the calibration, build the scene, check it, measure, solve, keep, report."""

import json
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.capture.checks import aged
from app.experiment.folder import Experiment, new_id, open_experiment, write_manifest
from app.experiment.results import write_result
from app.experiment.shift_files import write_shifts
from app.files.durable import write_text
from app.files.provenance import provenance
from app.files.toml import to_plain
from app.plan.make import settled
from app.reconstruct.agreement import rendered_agreement
from app.reconstruct.measure import Measurement, measure, with_calibration
from app.reconstruct.presets import preset as preset_called
from app.reconstruct.presets import resolved, solved
from app.report.page import write_report
from core.result import Solution
from core.solve.check import check_problem
from core.solve.recipes import regime_for
from core.watch import Watch


@dataclass(frozen=True)
class Reconstruction:
    """A finished reconstruction: its folder, the air, and what was measured."""

    folder: Path
    solution: Solution
    measurement: Measurement
    wall_s: float


def reconstruct(
    folder: Path,
    preset: str = "auto",
    *,
    watch: Watch = Watch(),
    into: Path | None = None,
) -> Reconstruction:
    """Reconstruct the newest captures of an experiment. Raises BadInputError, SettingError, StoppedError.

    The result goes to a new folder among the experiment's results, or to `into`, which exists. A solver keeps in
    `watch.store` what it can go on from; one that finds there another problem's, or other settings', starts afresh.
    """
    started = time.perf_counter()

    def on_stage(stage: str) -> None:
        watch.check_stop()
        watch.tell({"doing": stage})

    experiment = open_experiment(folder)
    preset = resolved(preset, experiment.settings.scene)
    solve = preset_called(preset)
    on_stage("load the calibration")
    scene, calibrated = with_calibration(experiment.settings.scene, experiment.bundle_path)
    on_stage("measure the shift of the pattern")
    measurement = measure(experiment, scene)
    check_problem(measurement.problem, regime_for(measurement.problem))
    on_stage("check the rendered reference against the captured one")
    checked = rendered_agreement(scene, measurement.references)
    on_stage("settle what auto leaves open")
    problem, choices = settled(measurement, preset)
    on_stage(f"solve ({preset})")
    solution = solved(solve, problem, watch)
    on_stage("keep the result")
    result = into or _new_folder(experiment, preset)
    told = {
        "assumed": [calibrated, *aged(experiment), *measurement.notes, checked, *solution.notes],
        "choices": [to_plain(choice) for choice in choices],
        "wall_s": time.perf_counter() - started,
    }
    _keep(result, experiment, preset, measurement, solution, told)
    on_stage("report")
    write_report(experiment.folder, result)
    return Reconstruction(result, solution, measurement, time.perf_counter() - started)


def _new_folder(experiment: Experiment, preset: str) -> Path:
    folder = experiment.results_folder / new_id(experiment.results_folder, preset)
    folder.mkdir(parents=True)
    return folder


def _told(value: float | str) -> float | str | None:
    """A number as JSON has it: what is not finite is none."""
    return value if isinstance(value, str) or math.isfinite(value) else None


def _keep(
    folder: Path,
    experiment: Experiment,
    preset: str,
    measurement: Measurement,
    solution: Solution,
    told: dict[str, Any],
) -> None:
    captures = {role: experiment.latest_capture(role) for role in ("reference", "flow")}
    write_result(
        folder / "result.nc",
        solution,
        {"title": experiment.settings.title, "preset": preset, "assumed": "\n".join(told["assumed"])},
    )
    write_shifts(folder, measurement.problem.shifts)
    lines = (json.dumps({name: _told(value) for name, value in row.items()}) for row in solution.history)
    write_text(folder / "history.jsonl", "".join(line + "\n" for line in lines))
    write_manifest(
        folder,
        {
            "schema_version": 1,
            "preset": preset,
            "outcome": solution.outcome.name,
            "advice": solution.outcome.value,
            "solver_s": solution.solver_s,
            **told,
            "captures": {role: path.name for role, path in captures.items()},
            "windows": [len(shift.displacement_px) for shift in measurement.problem.shifts],
            "settings": to_plain(experiment.settings),
        }
        | provenance({f"{role}_manifest": path / "manifest.json" for role, path in captures.items()}),
    )
