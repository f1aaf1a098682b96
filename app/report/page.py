"""`report`: one offline HTML file with the pictures that a person wants first.

A result is worth more than its report: what cannot be drawn says why in its place, and the rest is there.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape

from app.calibrate.folder import CalibrationFolder
from app.calibrate.page import figures, measured_model
from app.errors import BadInputError, explained
from app.experiment.folder import Experiment, open_experiment
from app.experiment.found import found_in
from app.files.durable import write_text
from app.report.answer import AtAGlance, advice, assumed, summary, tiles
from app.report.beside import places, rows
from app.report.figures import (
    as_data_uri,
    error_figure,
    found_figure,
    images_figure,
    shift_figure,
    slices_figure,
    volume_figure,
)
from app.report.finding import Finding, read_finding
from app.report.indoor import told
from app.report.maps_figure import maps_figure
from app.report.meaning import meaning
from app.report.room_figure import room_figure
from app.report.tables import facts, origin, score_rows
from app.volume.file import RoomVolume
from app.volume.score import truth_at
from core.displacement import standard_deviation_px
from core.drift import nearly_still
from core.occupied import HEAD_M
from core.result import Solution
from core.setting import SettingError
from core.significance import EITHER_WAY

Rows = Iterable[tuple[str, ...]]


@dataclass(frozen=True)
class Picture:
    """An image for the page, with the sentence below it."""

    uri: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A heading with its pictures, its table, a list and notes, and why what is missing is missing."""

    title: str
    figures: tuple[Picture, ...] = ()
    heads: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    points: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


def report_again(folder: Path, result: Path | None = None) -> Path:
    """Write report.html into the newest (or the given) result of an experiment. Raises BadInputError."""
    experiment = open_experiment(folder)
    result_folder = experiment.result(result)
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
        created=str(manifest.get("created", "at an unknown time"))
        .replace("T", " ")
        .replace("+00:00", " UTC"),
        sentences=summary(finding),
        tiles=_tiles(finding),
        sections=_sections(finding),
    )


def _sections(finding: Finding) -> list[Section]:
    manifest = finding.manifest
    made = [
        _air(finding),
        _indoor(finding),
        Section("What to do to know better", points=advice(finding)),
        _found(finding),
        _drawn("How sure it is", lambda: _known(finding.solution)),
        _compared(finding),
        _drawn("What the camera saw", lambda: _images(finding)),
        _drawn("How far the pattern moved", lambda: _shifts(finding)),
        *(
            _drawn(f"Calibration: {view.name}", lambda name=view.name: _calibration(finding.experiment, name))
            for view in finding.experiment.settings.scene.views
        ),
        Section("What was assumed", points=assumed(manifest)),
        _listed("What was known, and of what", lambda: facts(finding.experiment)),
        _listed("Where this came from", lambda: origin(manifest)),
    ]
    return [
        section
        for section in made
        if section.figures or section.rows or section.points or section.notes or section.missing
    ]


def _tiles(finding: Finding) -> tuple[AtAGlance, ...]:
    """Figures to be seen at a glance; a room without an occupied zone says so with its table."""
    try:
        return tiles(finding)
    except SettingError:
        return ()


def _compared(finding: Finding) -> Section:
    """The error on the planes and in numbers, where there is a truth."""
    title = "Against the truth"
    table = _listed(title, lambda: score_rows(finding), heads=("quantity", "error", "trivial answers"))
    drawn = _drawn(title, lambda: _errors(finding))
    return replace(table, figures=drawn.figures, missing=table.missing + drawn.missing)


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


def _found(finding: Finding) -> Section:
    """What stands before the wall and is not stated, outlined and told."""
    pictures = _drawn("What stands before the wall and is not stated", lambda: _outlined(finding))
    return replace(
        pictures, notes=tuple(f"{one.box.name}: {one.sentence}" for one in found_in(finding.manifest))
    )


def _outlined(finding: Finding) -> Iterable[Picture]:
    """The reference with what was found in it, for each view that has something."""
    everything = found_in(finding.manifest)
    for view in sorted({one.view for one in everything}):
        things = [one for one in everything if one.view == view]
        reference = finding.captures().reference.images[view].mean
        names = ", ".join(one.box.name for one in things)
        yield Picture(
            as_data_uri(found_figure(reference, things)), f"The reference image; outlined: {names}."
        )


def _shifts(finding: Finding) -> Iterable[Picture]:
    views = finding.experiment.settings.scene.views
    for shift, view in zip(finding.shifts(), views, strict=True):
        without = (
            " What a motion of the camera would explain is taken out." if shift.motion is not None else ""
        )
        still = nearly_still(shift)
        size_px = np.linalg.norm(still.displacement_px, axis=1)
        noise_px = float(np.median(standard_deviation_px(still)))
        yield Picture(
            as_data_uri(shift_figure(still)),
            f"{view.name}: measured shift, windows of {shift.window_px} px.{without} In the median "
            f"{1e3 * np.median(size_px):.2f} thousandths of a pixel, {np.median(size_px) / noise_px:.1f} times the "
            "noise of a window.",
        )


def _air(finding: Finding) -> Section:
    """The room as a picture, planes, and what was found at a few places with its interval."""
    pictures = _drawn(
        "The air",
        lambda: _room(finding),
        lambda: _planes(finding),
    )
    scene = finding.experiment.settings.scene
    table = _listed(
        "The air",
        lambda: rows(places(finding.solution, scene, _truth(finding))),
        ("place", "temperature, 95 %", "true", "speed, 95 %", "true"),
    )
    return replace(pictures, heads=table.heads, rows=table.rows, missing=pictures.missing + table.missing)


def _truth(finding: Finding) -> RoomVolume | None:
    try:
        return finding.truth
    except BadInputError:  # the pictures say so
        return None


def _room(finding: Finding) -> Iterable[Picture]:
    lines = " and lines along its flow" if finding.solution.velocity_m_s is not None else ""
    yield Picture(
        as_data_uri(room_figure(finding.solution, finding.experiment.settings.scene)),
        f"The room: the air's temperature on the middle plane{lines}.",
    )


def _planes(finding: Finding) -> Iterable[Picture]:
    arrows = "; arrows: velocity" if finding.solution.velocity_m_s is not None else ""
    yield Picture(as_data_uri(slices_figure(finding.solution)), f"Temperature on the middle planes{arrows}.")


def _known(solution: Solution) -> Iterable[Picture]:
    """How sure the solver is, and where the measurements rather than the model speak."""
    if solution.temperature_std_k is not None:
        figure = volume_figure(solution, EITHER_WAY * solution.temperature_std_k, "± K (95 %)")
        yield Picture(as_data_uri(figure), "Temperature: half of its 95 % interval.")
    if solution.velocity_std_m_s is not None:
        size = EITHER_WAY * np.linalg.norm(solution.velocity_std_m_s, axis=-1)
        figure = volume_figure(solution, size, "± m/s (95 %)")
        yield Picture(as_data_uri(figure), "Velocity: half of its 95 % interval.")
    if solution.informed is not None:
        figure = volume_figure(solution, solution.informed, "share measured", highest=1.0)
        yield Picture(
            as_data_uri(figure),
            "How much of the temperature's uncertainty the measurements removed: at 1 they tell it, at 0 the model "
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
    heads = ("quantity", "value", "95 %", "what it means")
    table = _listed(
        "People and ventilation",
        lambda: ((*told(one), meaning(one)) for one in finding.indoor.quantities),
        heads,
    )
    if not table.missing:
        table = replace(table, notes=(*finding.indoor.missing, *finding.indoor.notes))
    if finding.solution.velocity_m_s is None:
        return table
    maps = _drawn(table.title, lambda: _maps(finding))
    return replace(table, figures=maps.figures, missing=table.missing + maps.missing)


def _maps(finding: Finding) -> Iterable[Picture]:
    """Draught and age at the height of sitting people's heads."""
    yield Picture(
        as_data_uri(maps_figure(finding)),
        f"Seen from above, {HEAD_M:g} m over the floor; dashed: the zone where people are. A, B and C: where the "
        "categories of ISO 7730 end.",
    )


def _calibration(experiment: Experiment, camera: str) -> Iterable[Picture]:
    """Residuals, coverage and the rig of a camera that was measured; nothing for a given one."""
    folder = CalibrationFolder(experiment.folder)
    model = measured_model(folder, camera)
    if model is not None:
        for title, figure in figures(model, folder.bundle().of(camera, folder.is_first(camera))):
            yield Picture(as_data_uri(figure), title)
