"""`report`: one offline HTML file with the pictures that a person wants first."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape
from scipy.interpolate import RegularGridInterpolator

from app.calibrate.folder import CalibrationFolder
from app.calibrate.page import figures, measured_model
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, open_experiment, read_manifest
from app.experiment.results import read_result
from app.experiment.shift_files import read_shifts
from app.files.durable import write_text
from app.report.figures import (
    as_data_uri,
    error_figure,
    images_figure,
    shift_figure,
    slices_figure,
    volume_figure,
)
from app.volume.file import RoomVolume, read_volume
from app.volume.score import score_solution
from core.displacement import standard_deviation_px
from core.problem import ShiftMeasurement
from core.result import Solution


@dataclass(frozen=True)
class Picture:
    """An image for the page, with the sentence below it."""

    uri: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A heading and its pictures."""

    title: str
    figures: tuple[Picture, ...]


def write_report(folder: Path, result: Path | None = None) -> Path:
    """Write report.html into the newest (or the given) result. Raises BadInputError."""
    experiment = open_experiment(folder)
    result_folder = result or experiment.latest_result()
    path = result_folder / "report.html"
    write_text(path, render_report(experiment, result_folder))
    return path


def render_report(experiment: Experiment, result_folder: Path) -> str:
    """The page as text."""
    solution = read_result(result_folder / "result.nc")
    manifest = read_manifest(result_folder)
    shifts = read_shifts(result_folder)
    truth = _truth(experiment)
    environment = Environment(
        loader=PackageLoader("app.report"),
        autoescape=select_autoescape(),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html").render(
        title=experiment.settings.title or experiment.folder.name,
        experiment=experiment.folder.name,
        result=result_folder.name,
        preset=manifest["preset"],
        created=manifest["created"],
        sentences=summary(solution, shifts, truth),
        sections=_sections(experiment, manifest, solution, shifts, truth),
        scores=_score_rows(score_solution(solution, truth)) if truth else [],
        assumed=manifest["assumed"],
        choices=_choices(manifest),
        facts=_facts(experiment),
        origin=_origin(manifest),
    )


def summary(
    solution: Solution, shifts: tuple[ShiftMeasurement, ...], truth: RoomVolume | None
) -> tuple[str, ...]:
    """Three sentences: what was seen, what the air does, and how well that is known."""
    size = np.linalg.norm(shifts[0].displacement_px, axis=1)
    noise = float(np.median(standard_deviation_px(shifts[0])))
    ratio = float(np.median(size)) / noise
    seen = (
        f"The pattern moved by {1e3 * np.median(size):.2f} thousandths of a pixel in the median "
        f"({1e3 * np.percentile(size, 99):.2f} at the 99th percentile), {ratio:.1f} times the noise of a window."
    )
    t = solution.temperature_k
    air = (
        f"The air runs from {np.percentile(t, 1):.2f} to {np.percentile(t, 99):.2f} K "
        f"(1st to 99th percentile), {t.mean(axis=(0, 1))[-1] - t.mean(axis=(0, 1))[0]:+.2f} K from floor to ceiling."
    )
    if truth is None:
        return (
            seen,
            air,
            "There is no truth to compare with; the assumptions below say what was taken on trust.",
        )
    score = score_solution(solution, truth)["T"]
    trivial = score["trivial"]
    known = (
        f"Against the truth the temperature is off by {score['rms_K']:.3f} K (rms); the inlet wall's plane "
        f"carried through the room would be off by {trivial['inlet_plane']:.3f} K, ambient by "
        f"{trivial['ambient']:.2f} K, and the truth's own mean along the view by {trivial['y_mean']:.3f} K."
    )
    return seen, air, known


def _sections(
    experiment: Experiment,
    manifest: dict[str, Any],
    solution: Solution,
    shifts: tuple[ShiftMeasurement, ...],
    truth: RoomVolume | None,
) -> list[Section]:
    captures = [
        load_capture(experiment.captures_folder / manifest["captures"][role])
        for role in ("reference", "flow")
    ]
    seen = [
        Picture(
            as_data_uri(images_figure(captures[0].images[i].mean, captures[1].images[i].mean)),
            f"{view.name}: mean images, drawn at reduced size. The shift is too small to be seen in them.",
        )
        for i, view in enumerate(experiment.settings.scene.views)
    ]
    moved = [
        Picture(as_data_uri(shift_figure(shift)), f"Measured shift, windows of {shift.window_px} px.")
        for shift in shifts
    ]
    ambient = experiment.settings.scene.air.ambient_temperature_k
    arrows = ", arrows: velocity" if solution.velocity_m_s is not None else ""
    air = [
        Picture(
            as_data_uri(slices_figure(solution, ambient)),
            f"Temperature above ambient ({ambient:.2f} K) on the middle planes{arrows}.",
        )
    ]
    air += _known(solution)
    if truth is not None:
        error = solution.temperature_k - _truth_at(truth, solution)
        air.append(
            Picture(
                as_data_uri(error_figure(solution, error)), "Temperature minus truth, on the same planes."
            )
        )
    return [
        Section("What the camera saw", tuple(seen)),
        Section("How far the pattern moved", tuple(moved)),
        Section("The air", tuple(air)),
        *_calibration(experiment),
    ]


def _known(solution: Solution) -> list[Picture]:
    """How sure the solver is, and where the measurements rather than the model speak."""
    pictures = []
    if solution.temperature_std_k is not None:
        figure = volume_figure(solution, solution.temperature_std_k, "one sigma of T [K]")
        pictures.append(Picture(as_data_uri(figure), "Standard deviation of the temperature."))
    if solution.velocity_std_m_s is not None:
        size = np.linalg.norm(solution.velocity_std_m_s, axis=-1)
        figure = volume_figure(solution, size, "one sigma of u [m/s]")
        pictures.append(Picture(as_data_uri(figure), "Standard deviation of the velocity."))
    if solution.informed is not None:
        figure = volume_figure(solution, solution.informed, "informed [1]", highest=1.0)
        pictures.append(
            Picture(
                as_data_uri(figure),
                "Share of the temperature's prior variance that the measurements removed: at 0 the model "
                "speaks alone.",
            )
        )
    return pictures


def _calibration(experiment: Experiment) -> list[Section]:
    """Residuals, coverage and the rig of each camera that was measured; nothing for a given one."""
    folder = CalibrationFolder(experiment.folder)
    found = []
    for view in experiment.settings.scene.views:
        model = measured_model(folder, view.name)
        if model is not None:
            pictures = (Picture(as_data_uri(f), title) for title, f in figures(model, folder.bundle()))
            found.append(Section(f"Calibration: {view.name}", tuple(pictures)))
    return found


def _truth(experiment: Experiment) -> RoomVolume | None:
    path = experiment.folder / "truth.npz"
    return read_volume(path) if path.exists() else None


def _truth_at(truth: RoomVolume, solution: Solution) -> np.ndarray:
    axes = (truth.x_m, truth.y_m, truth.z_m)
    own = (solution.x_m, solution.y_m, solution.z_m)
    clipped = [np.clip(mine, axis[0], axis[-1]) for mine, axis in zip(own, axes, strict=True)]
    mesh = np.stack(np.meshgrid(*clipped, indexing="ij"), axis=-1)
    return RegularGridInterpolator(axes, truth.temperature_k.astype(np.float64))(mesh)


def _score_rows(scores: dict[str, Any]) -> list[tuple[str, str, str]]:
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


def _choices(manifest: dict[str, Any]) -> list[tuple[str, str, str, str, str]]:
    """What auto resolved to: name, value, bound against limit, cost, reason; none in results of old."""
    rows = []
    for choice in manifest.get("choices", []):
        held = f"{choice['bound']:.1g} of {choice['limit']:.1g} {choice['unit']}" if choice["limit"] else "-"
        cost = f"{100 * choice['cost_share']:.0f} %" if choice["cost_share"] >= 0.005 else "below 1 %"
        rows.append((choice["name"], str(choice["value"]), held, cost, choice["reason"]))
    return rows


def _origin(manifest: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [
        ("outcome", f"{manifest['outcome']}: {manifest['advice']}"),
        (
            "time",
            f"solver {manifest['solver_s']:.1f} s, all {manifest['wall_s']:.1f} s on {manifest['device']}",
        ),
        ("versions", ", ".join(f"{name} {version}" for name, version in manifest["versions"].items())),
    ]
    rows += [
        (name, f"{entry['file']}, sha256 {entry['sha256']}") for name, entry in manifest["inputs"].items()
    ]
    return rows
