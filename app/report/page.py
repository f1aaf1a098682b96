"""`report`: one offline HTML file with the pictures that a person wants first.

A result is worth more than its report: what cannot be drawn says why in its place, and the rest is there.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape

from app.calibrate.folder import CalibrationFolder
from app.calibrate.page import figures, measured_model
from app.errors import explained
from app.experiment.folder import Experiment, open_experiment
from app.files.durable import write_text
from app.report.figures import (
    Plan,
    as_data_uri,
    error_figure,
    images_figure,
    plans_figure,
    shift_figure,
    slices_figure,
    volume_figure,
)
from app.report.finding import Finding, read_finding
from app.report.indoor import age_of_air, draught_percent, indoor, told
from app.volume.score import truth_at
from core.displacement import standard_deviation_px
from core.drift import nearly_still
from core.occupied import HEAD_M, at_height
from core.result import Solution
from core.scene import Scene

Rows = Iterable[tuple[str, ...]]


@dataclass(frozen=True)
class Picture:
    """An image for the page, with the sentence below it."""

    uri: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A heading with its pictures or its table, and why what is missing is missing."""

    title: str
    figures: tuple[Picture, ...] = ()
    heads: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    missing: tuple[str, ...] = ()


def report_again(folder: Path, result: Path | None = None) -> Path:
    """Write report.html into the newest (or the given) result of an experiment. Raises BadInputError."""
    experiment = open_experiment(folder)
    result_folder = result or experiment.latest_result()
    return write_report(read_finding(experiment, result_folder), result_folder)


def write_report(finding: Finding, folder: Path) -> Path:
    """Write report.html into a result's folder. Raises OSError."""
    path = folder / "report.html"
    write_text(path, render_report(finding))
    return path


def render_report(finding: Finding) -> str:
    """The page as text."""
    environment = Environment(
        loader=PackageLoader("app.report"),
        autoescape=select_autoescape(),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    experiment, manifest = finding.experiment, finding.manifest
    return environment.get_template("report.html").render(
        title=experiment.settings.title or experiment.folder.name,
        experiment=experiment.folder.name,
        result=finding.name,
        preset=manifest.get("preset", "unknown"),
        created=manifest.get("created", "at an unknown time"),
        sentences=summary(finding),
        sections=_sections(finding),
    )


def summary(finding: Finding) -> tuple[str, ...]:
    """Three sentences: what was seen, what the air does, and how well that is known."""
    made = []
    for say in (_seen, _air_in_words, _known_in_words):
        try:
            made.append(say(finding))
        except Exception as error:  # a result without one of its sentences is still a result
            made.append(f"Not told: {explained(error)}")
    return tuple(made)


def _seen(finding: Finding) -> str:
    # A motion of the camera that is still in the shifts says nothing of the air.
    shift = nearly_still(finding.shifts()[0])
    size = np.linalg.norm(shift.displacement_px, axis=1)
    noise = float(np.median(standard_deviation_px(shift)))
    ratio = float(np.median(size)) / noise
    return (
        f"The pattern moved by {1e3 * np.median(size):.2f} thousandths of a pixel in the median "
        f"({1e3 * np.percentile(size, 99):.2f} at the 99th percentile), {ratio:.1f} times the noise of a window."
    )


def _air_in_words(finding: Finding) -> str:
    t = finding.solution.temperature_k
    upwards_k = np.nanmean(t, axis=(0, 1))
    return (
        f"The air runs from {np.nanpercentile(t, 1):.2f} to {np.nanpercentile(t, 99):.2f} K "
        f"(1st to 99th percentile), {upwards_k[-1] - upwards_k[0]:+.2f} K from floor to ceiling."
    )


def _known_in_words(finding: Finding) -> str:
    if finding.scores is None:
        return "There is no truth to compare with; the assumptions below say what was taken on trust."
    score = finding.scores["T"]
    trivial = score["trivial"]
    return (
        f"Against the truth the temperature is off by {score['rms_K']:.3f} K (rms); the inlet wall's plane "
        f"carried through the room would be off by {trivial['inlet_plane']:.3f} K, ambient by "
        f"{trivial['ambient']:.2f} K, and the truth's own mean along the view by {trivial['y_mean']:.3f} K."
    )


def _sections(finding: Finding) -> list[Section]:
    manifest = finding.manifest
    made = [
        _drawn("What the camera saw", lambda: _images(finding)),
        _drawn("How far the pattern moved", lambda: _shifts(finding)),
        _drawn("The air", lambda: _air(finding), lambda: _known(finding.solution), lambda: _errors(finding)),
        _indoor(finding),
        *(
            _drawn(f"Calibration: {view.name}", lambda name=view.name: _calibration(finding.experiment, name))
            for view in finding.experiment.settings.scene.views
        ),
        _listed(
            "Against the truth", lambda: _score_rows(finding), heads=("quantity", "error", "trivial answers")
        ),
        _listed("What was assumed", lambda: ((sentence,) for sentence in manifest["assumed"])),
        _listed("What was known, and of what", lambda: _facts(finding.experiment)),
        _listed("Where this came from", lambda: _origin(manifest)),
    ]
    return [section for section in made if section.figures or section.rows or section.missing]


def _drawn(title: str, *parts: Callable[[], Iterable[Picture]]) -> Section:
    """The pictures of a section; a part that fails says why, and the others are drawn."""
    pictures: list[Picture] = []
    missing: list[str] = []
    for part in parts:
        try:
            pictures += part()
        except Exception as error:  # no picture may cost a result
            missing.append(f"Not drawn: {explained(error)}")
    return Section(title, figures=tuple(pictures), missing=tuple(missing))


def _listed(title: str, make: Callable[[], Rows], heads: tuple[str, ...] = ()) -> Section:
    """The table of a section, or why there is none."""
    try:
        return Section(title, heads=heads, rows=tuple(make()))
    except Exception as error:  # no table may cost a result
        return Section(title, missing=(f"Not listed: {explained(error)}",))


def _images(finding: Finding) -> Iterable[Picture]:
    pair = finding.captures()
    for before, after, view in zip(
        pair.reference.images, pair.flow.images, finding.experiment.settings.scene.views, strict=True
    ):
        yield Picture(
            as_data_uri(images_figure(before.mean, after.mean)),
            f"{view.name}: mean images, drawn at reduced size. The shift is too small to be seen in them.",
        )


def _shifts(finding: Finding) -> Iterable[Picture]:
    for shift in finding.shifts():
        without = (
            " What a motion of the camera would explain is taken out." if shift.motion is not None else ""
        )
        yield Picture(
            as_data_uri(shift_figure(nearly_still(shift))),
            f"Measured shift, windows of {shift.window_px} px.{without}",
        )


def _air(finding: Finding) -> Iterable[Picture]:
    ambient = finding.experiment.settings.scene.air.ambient_temperature_k
    arrows = ", arrows: velocity" if finding.solution.velocity_m_s is not None else ""
    yield Picture(
        as_data_uri(slices_figure(finding.solution, ambient)),
        f"Temperature above ambient ({ambient:.2f} K) on the middle planes{arrows}.",
    )


def _known(solution: Solution) -> Iterable[Picture]:
    """How sure the solver is, and where the measurements rather than the model speak."""
    if solution.temperature_std_k is not None:
        figure = volume_figure(solution, solution.temperature_std_k, "one sigma of T [K]")
        yield Picture(as_data_uri(figure), "Standard deviation of the temperature.")
    if solution.velocity_std_m_s is not None:
        size = np.linalg.norm(solution.velocity_std_m_s, axis=-1)
        figure = volume_figure(solution, size, "one sigma of u [m/s]")
        yield Picture(as_data_uri(figure), "Standard deviation of the velocity.")
    if solution.informed is not None:
        figure = volume_figure(solution, solution.informed, "informed [1]", highest=1.0)
        yield Picture(
            as_data_uri(figure),
            "Share of the temperature's prior variance that the measurements removed: at 0 the model "
            "speaks alone.",
        )


def _errors(finding: Finding) -> Iterable[Picture]:
    if finding.truth is not None:
        solution = finding.solution
        error = solution.temperature_k - truth_at(finding.truth, solution, finding.truth.temperature_k)
        yield Picture(
            as_data_uri(error_figure(solution, error)), "Temperature minus truth, on the same planes."
        )


def _indoor(finding: Finding) -> Section:
    """Figures and maps for people and for ventilation."""
    solution, scene = finding.solution, finding.experiment.settings.scene
    table = _listed(
        "People and ventilation", lambda: _indoor_rows(solution, scene), ("quantity", "value", "95 %")
    )
    if solution.velocity_m_s is None:
        return table
    maps = _drawn(table.title, lambda: _maps(solution, scene))
    return replace(table, figures=maps.figures, missing=table.missing + maps.missing)


def _indoor_rows(solution: Solution, scene: Scene) -> Iterable[tuple[str, ...]]:
    found = indoor(solution, scene)
    yield from (told(quantity) for quantity in found.quantities)
    yield from (("not told", sentence, "") for sentence in found.missing)
    yield from (("taken", sentence, "") for sentence in found.notes)


def _maps(solution: Solution, scene: Scene) -> Iterable[Picture]:
    """Draught and age at the height of sitting people's heads."""
    draught = at_height(draught_percent(solution), solution.z_m, HEAD_M)
    plans = [Plan("draught rate", "%", solution.x_m, solution.y_m, draught, "gouraud")]
    change = age_of_air(solution, scene)
    x_m, y_m, z_m = change.flow.axes_m
    layer = min(int(HEAD_M / (z_m[1] - z_m[0])), len(z_m) - 2)
    plans.append(Plan("age of the air", "min", x_m, y_m, change.age_s[:, :, layer] / 60.0, "flat"))
    yield Picture(
        as_data_uri(plans_figure(plans)),
        f"Seen from above, {HEAD_M:g} m over the floor: draught rate and age of the air.",
    )


def _calibration(experiment: Experiment, camera: str) -> Iterable[Picture]:
    """Residuals, coverage and the rig of a camera that was measured; nothing for a given one."""
    folder = CalibrationFolder(experiment.folder)
    model = measured_model(folder, camera)
    if model is not None:
        for title, figure in figures(model, folder.bundle()):
            yield Picture(as_data_uri(figure), title)


def _score_rows(finding: Finding) -> list[tuple[str, ...]]:
    scores = finding.scores
    if scores is None:
        return []
    t = scores["T"]
    trivial = t["trivial"]
    rows = [
        (
            "temperature, rms",
            f"{t['rms_K']:.3f} K",
            f"ambient {trivial['ambient']:.3f} K, inlet plane {trivial['inlet_plane']:.3f} K, "
            f"true mean along the view {trivial['y_mean']:.3f} K",
        ),
        (
            "temperature, relative to its departure from each height's mean",
            _relative(t["rel_departure"]),
            "mean at each height: 1",
        ),
    ]
    if scores["u"]:
        rows.append(("velocity, relative", _relative(scores["u"]["rel"]), "still air: 1"))
        rows.append(("velocity in the jet, relative", _relative(scores["u"]["jet_rel"]), "still air: 1"))
    if scores["p"]:
        rows.append(("pressure, relative", _relative(scores["p"]["rel"]), "constant: 1"))
    return rows


def _relative(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _facts(experiment: Experiment) -> list[tuple[str, str]]:
    scene = experiment.settings.scene
    view = scene.views[0]
    x, y, z = scene.room.size_m
    cx, cy, cz = view.camera.position_m
    facts = [
        ("room", f"{x:g} x {y:g} x {z:g} m"),
        ("camera", f"{view.camera.width_px} x {view.camera.height_px} px at ({cx:g}, {cy:g}, {cz:g}) m"),
        ("averaging", f"{view.frames} frames, full well {view.noise.full_well_e:g} e-"),
        ("light", f"{scene.light.kind}, {scene.light.pattern.kind} pattern"),
    ]
    if experiment.settings.information:
        facts.append(("level of information", experiment.settings.information))
    facts += [(known.kind.replace("_", " "), _describe(known)) for known in scene.boundary]
    return facts


def _describe(known: Any) -> str:
    place = known.wall if hasattr(known, "wall") else getattr(getattr(known, "patch", None), "wall", "")
    parts = [str(place)] if place else []
    for name, unit in (("temperature_k", "K"), ("mean_temperature_k", "K")):
        if getattr(known, name, None) is not None:
            parts.append(f"{getattr(known, name):.2f} {unit}")
    if hasattr(known, "velocity_m_s"):
        parts.append("velocity " + ", ".join(f"{v:g}" for v in known.velocity_m_s) + " m/s")
    if hasattr(known, "thermal"):
        parts.append(f"{known.thermal}, {'no slip' if known.no_slip else 'slip'}")
    if hasattr(known, "file"):
        parts.append(known.file)
    return ", ".join(parts)


def _origin(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [
        ("outcome", f"{manifest['outcome']}: {manifest['advice']}"),
        (
            "time",
            f"solver {manifest['solver_s']:.1f} s, all {manifest['wall_s']:.1f} s on {manifest['device']}",
        ),
        ("versions", ", ".join(f"{name} {version}" for name, version in manifest["versions"].items())),
    ]
    rows += [
        (name, f"{entry.get('capture', '')} {entry['file']}, sha256 {entry['sha256']}".strip())
        for name, entry in manifest["inputs"].items()
    ]
    return rows
