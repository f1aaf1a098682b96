"""The calibration as figures: residuals, coverage, the rig in 3D, and what its uncertainty does to the shift.

`figures` makes them from a record and its bundle; a report embeds them, `airlens calibrate page` writes
them as one offline HTML file.
"""

import html

import numpy as np
from matplotlib.figure import Figure

from app.calibrate.folder import CalibrationFolder
from app.calibrate.steps import own_model
from app.errors import BadInputError
from app.files.durable import write_text
from app.report.figures import as_data_uri
from calibration.advice import coverage
from calibration.bundle import Bundle
from calibration.errors import CalibrationError
from calibration.further_projector import FurtherProjector
from calibration.intrinsics import Intrinsics
from calibration.model import Model
from calibration.sensitivity import shift_uncertainty
from calibration.turned import turned
from core.geometry import Optics


def fragment(calibration: CalibrationFolder, camera: str = "camera") -> str:
    """HTML of all figures and advice, without <html>. Raises BadInputError when nothing is calibrated."""
    model = measured_model(calibration, camera)
    if model is None:
        raise BadInputError(
            f"{calibration.folder} holds no record of camera {camera!r}; run 'airlens calibrate camera' first."
        )
    bundle = calibration.bundle().of(camera, calibration.is_first(camera))
    parts = [
        f'<figure><img alt="{html.escape(title)}" src="{as_data_uri(figure)}">'
        f"<figcaption>{html.escape(title)}</figcaption></figure>"
        for title, figure in figures(model, bundle)
    ]
    own = model.optics if isinstance(model, FurtherProjector) else model.projector_optics
    advice = [] if isinstance(model, FurtherProjector) else [*model.camera_optics.quality.advice]
    if own is not None:
        advice += [f"Projector: {a}" for a in own.quality.advice]
    items = "".join(f"<li>{html.escape(a)}</li>" for a in advice) or "<li>Nothing to retake.</li>"
    return f'<section class="calibration"><h2>Calibration</h2>{"".join(parts)}<ul>{items}</ul></section>'


def measured_model(calibration: CalibrationFolder, camera: str = "camera") -> Model | FurtherProjector | None:
    """The models of a measured calibration; none where nothing was measured. Raises BadInputError."""
    record = calibration.record(camera)
    if record is None:
        return None
    try:
        return own_model(calibration, record)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error


def write_page(calibration: CalibrationFolder, camera: str = "camera") -> str:
    """Write calibration/calibration.html and return its path. Raises BadInputError."""
    path = calibration.folder / "calibration.html"
    style = "body{font-family:sans-serif;max-width:60rem;margin:auto}img{max-width:100%}"
    head = f'<meta charset="utf-8"><title>Calibration</title><style>{style}</style>'
    write_text(
        path, f"<!doctype html><html><head>{head}</head><body>{fragment(calibration, camera)}</body></html>"
    )
    return str(path)


def figures(model: Model | FurtherProjector, bundle: Bundle) -> list[tuple[str, Figure]]:
    """Titles and figures, each only where its data are known; `bundle` is that of the model's view."""
    if isinstance(model, FurtherProjector):
        size_px = model.record.panel_size_px or (1, 1)
        return [("Projector: residuals (enlarged) and coverage", _residuals(model.projector, size_px))]
    record = model.record
    # A camera of another wall is drawn in its own frame, in which that wall is the back one.
    bundle = turned(bundle, record.placement.wall)
    found = [("Camera: residuals (enlarged) and coverage", _residuals(model.camera, record.camera_size_px))]
    if model.pair is not None and record.panel_size_px is not None:
        title = "Projector: residuals (enlarged) and coverage"
        found.append((title, _residuals(model.pair.projector, record.panel_size_px)))
    if bundle.wall is not None:
        found.append(("The rig: camera, projector and wall [m]", _rig(bundle)))
        found.append(("What the calibration's uncertainty does to the picture", _uncertainty(bundle)))
    return found


def _residuals(fit: Intrinsics, size_px: tuple[int, int]) -> Figure:
    """Residual vectors over the coverage cells."""
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    axes = figure.subplots()
    seen = coverage(tuple(s.pixels_px for s in fit.sightings), size_px)
    extent = (0, size_px[0], size_px[1], 0)
    axes.imshow(np.where(seen, 1.0, 0.85), extent=extent, cmap="gray", vmin=0, vmax=1, aspect="equal")
    pixels = np.concatenate([s.pixels_px for s in fit.sightings])
    left = np.concatenate(fit.adjusted.residuals_px)
    # Two percent of the picture's width stands for the rms.
    enlarge = 0.02 * size_px[0] / max(fit.rms_px, 1e-9)
    arrows = axes.quiver(
        *pixels.T, *(left * enlarge).T, np.linalg.norm(left, axis=1),
        angles="xy", scale_units="xy", scale=1, width=0.002, cmap="viridis",
    )  # fmt: skip
    figure.colorbar(arrows, label="residual [px]")
    axes.set(xlim=(0, size_px[0]), ylim=(size_px[1], 0), xlabel="column [px]", ylabel="row [px]")
    axes.set_title(f"rms {fit.rms_px:.3f} px, {len(fit.sightings)} views, distortion: {fit.model}")
    return figure


def _rig(bundle: Bundle) -> Figure:
    """Frusta to the wall, in the world."""
    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    wall_y_m = bundle.wall.point_m[1] if bundle.wall else 1.0
    devices = [(c.name, c.optics, "tab:blue") for c in bundle.cameras]
    if bundle.projector is not None:
        devices.append(("projector", bundle.projector.optics, "tab:orange"))
    for name, optics, colour in devices:
        origin = np.array(optics.position_m)
        corners = _corners_m(optics, wall_y_m)
        for corner in corners:
            axes.plot(*np.stack([origin, corner], axis=1), color=colour, linewidth=0.8)
        axes.plot(*np.concatenate([corners, corners[:1]]).T, color=colour, label=name)
        axes.scatter(*origin[:, None], color=colour)
    axes.set(xlabel="x", ylabel="y", zlabel="z")
    axes.set_aspect("equal")
    axes.legend()
    return figure


def _corners_m(optics: Optics, wall_y_m: float) -> np.ndarray:
    """Where the picture's corners meet the wall; three metres ahead where they look away from it."""
    (fx, fy), (cx, cy) = optics.focal_px, optics.principal_px
    w, h = optics.width_px - 1, optics.height_px - 1
    flat = np.array([[-cx / fx, -cy / fy, 1], [(w - cx) / fx, -cy / fy, 1],
                     [(w - cx) / fx, (h - cy) / fy, 1], [-cx / fx, (h - cy) / fy, 1]])  # fmt: skip
    towards = flat @ optics.rotation
    reach = np.where(
        towards[:, 1] > 0.1, (wall_y_m - optics.position_m[1]) / np.maximum(towards[:, 1], 0.1), 3.0
    )
    return np.array(optics.position_m) + reach[:, None] * towards


def _uncertainty(bundle: Bundle) -> Figure:
    """Maps of the pattern's misplacement and of the relative error of a shift."""
    found = shift_uncertainty(bundle, steps=9)
    optics = bundle.camera().optics
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    panels = (
        ("the pattern's place [px]", found.placement_std_px),
        ("a shift of 1 px [px]", found.shift_std_per_px),
    )
    for axes, (title, values) in zip(figure.subplots(1, 2), panels, strict=True):
        extent = (0, optics.width_px, optics.height_px, 0)
        drawn = axes.imshow(values.reshape(9, 9), extent=extent, aspect="equal")
        figure.colorbar(drawn, ax=axes)
        axes.set_title(f"standard deviation of {title}", fontsize=9)
    return figure
