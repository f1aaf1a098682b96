"""The story on one screen: what is known, the captures, the shift, the problem, the air; kept and told."""

import json
import math
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.capture.checks import aged
from app.errors import explained
from app.experiment.captures import newest_pair
from app.experiment.folder import Experiment, new_id, open_experiment, write_manifest
from app.experiment.results import write_result
from app.experiment.shift_files import write_shifts
from app.files.durable import write_text
from app.files.provenance import provenance
from app.files.toml import to_plain
from app.plan.task import task_in
from app.plan.under_way import UnderWay
from app.reconstruct.agreement import rendered_agreement
from app.reconstruct.measure import Measurement, measure
from app.reconstruct.names import AUTO
from app.reconstruct.presets import check_data_term, resolved, solved
from app.reconstruct.presets import preset as preset_called
from app.reconstruct.problem import known_of, problem_of
from app.reconstruct.sequence import check_sequence, with_departures
from app.report.finding import Finding
from app.report.page import write_report
from app.volume.comparison import left_thermometers
from core.problem import Problem
from core.result import Solution
from core.watch import Watch


@dataclass(frozen=True)
class Reconstruction:
    """A finished reconstruction: its folder, what was solved, and the air.

    `no_report` says why there is no report, where there is none. `promised_s` is what was promised, None where
    nothing was: all of it, the process' start too where that is known.
    """

    folder: Path
    finding: Finding
    problem: Problem
    measurement: Measurement
    wall_s: float
    no_report: str = ""
    promised_s: float | None = None

    @property
    def solution(self) -> Solution:
        """The air that was found."""
        return self.finding.solution


def reconstruct(
    folder: Path,
    preset: str = AUTO,
    *,
    sequence: bool = False,
    watch: Watch = Watch(),
    into: Path | None = None,
    start_s: float | None = None,
) -> Reconstruction:
    """Reconstruct the newest captures of an experiment. Raises BadInputError, SettingError, StoppedError.

    With `sequence` the temperature of each burst of the newest flow is found as well, as a departure from the mean.

    The result goes to a new folder among the experiment's results, or to `into`, which exists. A solver keeps in
    `watch.store` what it can go on from; one that finds there another problem's, or other settings', starts afresh.
    Rows that are told say `left_s`, the seconds yet, where the machine's runs, a plan or the scene tell them; the
    one before the captures are read says so in words (`promised`). `start_s` is what the process took until now,
    where it serves this run alone. Promises are learned from every run that did not go on from an earlier one.
    """
    started, under_way = time.perf_counter(), UnderWay(start_s)
    watch = under_way.watched(watch)

    def on_stage(doing: str, stage: str, **more: str) -> None:
        under_way.enter(stage)
        watch.check_stop()
        watch.tell({"doing": doing, **more})

    experiment = open_experiment(folder)
    on_stage("read what is known", "read")
    known = known_of(experiment)
    preset = resolved(preset, known.scene)
    solve = preset_called(preset)
    check_data_term(preset, known.scene)
    for role in ("reference", "flow"):
        experiment.latest_capture(role)  # what is missing is told before any time is promised
    # A sequence takes longer than the preset alone, of which the promise is.
    under_way.begin(task_in(experiment, known, preset), afresh=not watch.store and not sequence)
    on_stage("read the captures", "read", promised=under_way.said)
    captures = newest_pair(experiment)
    if sequence:
        check_sequence(captures)
    on_stage("measure the shift of the pattern", "measure")
    measurement = measure(captures, known.scene, watch)
    # With what was found to stand in the room.
    standing = replace(known, scene=measurement.scene)
    problem = problem_of(standing, measurement.shifts, measurement.images)
    on_stage("check the rendered reference against the captured one", "measure")
    checked = rendered_agreement(known.scene, captures.reference)
    on_stage(f"solve ({preset})", "solve")
    solution = solved(solve, problem, watch)
    if sequence:
        solution = with_departures(solution, measurement, watch)
    on_stage("keep the result", "report")
    stands = [one.sentence for one in measurement.found]
    told = [known.optics, *aged(experiment, captures), *measurement.notes, *stands, checked, *solution.notes]
    told += left_thermometers(experiment, solution)
    result = into or _new_folder(experiment, preset)
    manifest = _manifest(experiment, preset, measurement, solution, told, time.perf_counter() - started)
    finding = Finding(
        experiment, result.name, manifest, solution, lambda: measurement.shifts, lambda: captures
    )
    _keep(result, finding, measurement)
    on_stage("report", "report")
    no_report = _reported(finding, result)
    under_way.keep()
    wall_s = time.perf_counter() - started
    return Reconstruction(
        result, finding, problem, measurement, wall_s, no_report=no_report, promised_s=under_way.promised_s
    )


def _new_folder(experiment: Experiment, preset: str) -> Path:
    folder = experiment.results_folder / new_id(experiment.results_folder, preset)
    folder.mkdir(parents=True)
    return folder


def _told(value: float | str) -> float | str | None:
    """A number as JSON has it: what is not finite is none."""
    return value if isinstance(value, str) or math.isfinite(value) else None


def _manifest(
    experiment: Experiment,
    preset: str,
    measurement: Measurement,
    solution: Solution,
    assumed: list[str],
    wall_s: float,
) -> dict[str, Any]:
    captures = measurement.captures
    return {
        "schema_version": 1,
        "preset": preset,
        "outcome": solution.outcome.name,
        "advice": solution.outcome.value,
        "solver_s": solution.solver_s,
        "assumed": assumed,
        "found": to_plain(measurement.found),
        "wall_s": wall_s,
        "captures": captures.names,
        "bursts": [burst.folder.name for burst in captures.bursts],
        "windows": [len(shift.displacement_px) for shift in measurement.shifts],
        "settings": to_plain(experiment.settings),
        "inputs": captures.inputs,
        **provenance(),
    }


def _keep(folder: Path, finding: Finding, measurement: Measurement) -> None:
    """Everything that the result is; its manifest last."""
    manifest, solution = finding.manifest, finding.solution
    write_result(
        folder / "result.nc",
        solution,
        {
            "title": finding.experiment.settings.title,
            "preset": manifest["preset"],
            "assumed": "\n".join(manifest["assumed"]),
            "began": _began(measurement),
        },
        finding.derived,
    )
    write_shifts(folder, measurement.shifts)
    lines = (json.dumps({name: _told(value) for name, value in row.items()}) for row in solution.history)
    write_text(folder / "history.jsonl", "".join(line + "\n" for line in lines))
    write_manifest(folder, dict(manifest))


def _began(measurement: Measurement) -> str:
    """The moment of the first burst in UTC, as CF writes it."""
    captures = measurement.captures
    first = captures.bursts[0].manifest if captures.bursts else captures.flow.manifest
    moment = datetime.fromisoformat(str(first["created"])).astimezone(UTC)
    return moment.strftime("%Y-%m-%d %H:%M:%S")


def _reported(finding: Finding, folder: Path) -> str:
    """Write the report; why there is none where it cannot be written: the result is kept."""
    try:
        write_report(finding, folder)
    except Exception as error:  # whatever stops the page, the result is there
        return (
            f"The result is kept; its report could not be written: {explained(error)} Then: airlens report."
        )
    return ""
