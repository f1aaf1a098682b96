"""Tables of a report: errors against the truth, what was known, and where a result came from."""

from collections.abc import Mapping
from typing import Any

from app.experiment.folder import Experiment
from app.report.finding import Finding


def score_rows(finding: Finding) -> list[tuple[str, ...]]:
    """The project's yardstick beside trivial answers; nothing where there is no truth."""
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
            "temperature of the air, without walls' surfaces, rms",
            f"{t['air']['rms_K']:.3f} K",
            f"inlet plane {t['air']['inlet_plane']:.3f} K",
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


def facts(experiment: Experiment) -> list[tuple[str, str]]:
    """The rig, and what was known of the room."""
    scene = experiment.settings.scene
    x, y, z = scene.room.size_m
    rows = [("room", f"{x:g} x {y:g} x {z:g} m")]
    for view in scene.views:
        name, whose = (view.name, f"{view.name}: ") if len(scene.views) > 1 else ("camera", "")
        cx, cy, cz = view.camera.position_m
        size = f"{view.camera.width_px} x {view.camera.height_px} px"
        light = view.light or scene.light
        rows += [
            (name, f"{size} at ({cx:g}, {cy:g}, {cz:g}) m, looks at {view.wall}"),
            (f"{whose}averaging", f"{view.frames} frames, full well {view.noise.full_well_e:g} e-"),
            (f"{whose}light", f"{light.kind}, {light.pattern.kind} pattern"),
        ]
    if experiment.settings.information:
        rows.append(("level of information", experiment.settings.information))
    rows += [(known.kind.replace("_", " "), _describe(known)) for known in scene.boundary]
    return rows


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


def origin(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How the result ended, what it took, and the hashes of what it came from."""
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
