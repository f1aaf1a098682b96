"""A calibration step in plain data and plain words: what `airlens calibrate` prints."""

import math
from typing import Any

import numpy as np

from app.calibrate.steps import StepOutcome
from calibration.bundle import CalibratedOptics
from calibration.further_projector import FurtherProjector
from calibration.intrinsics import Intrinsics
from calibration.model import Model
from calibration.vertical import upper_edge


def summary(step: StepOutcome, seconds: float) -> dict[str, Any]:
    """The step as JSON values."""
    found: dict[str, Any] = {
        "complete": step.model is not None,
        "boards": len(step.record.boards),
        "issues": [*step.issues, *([step.missing] if step.missing else [])],
        "seconds": round(seconds, 2),
    }
    if step.model is None:
        return found
    model = step.model
    if isinstance(model, FurtherProjector):
        lit = [b.name for b in model.record.boards if b.panel_px]
        return found | {
            "projector": _device(model.projector, model.optics, lit),
            "camera": None,
            "stereo": {
                "rms_px": model.rms_px,
                "baseline_m": float(np.linalg.norm(model.adjusted.devices[1].translation_m)),
            },
        }
    names = [b.name for b in model.record.boards]
    found["camera"] = _device(model.camera, model.camera_optics, names)
    if model.pair is not None and model.projector_optics is not None:
        lit = [b.name for b in model.record.boards if b.panel_px]
        found["projector"] = _device(model.pair.projector, model.projector_optics, lit)
        found["stereo"] = _stereo(model)
    if model.wall is not None:
        wall = model.wall
        found["wall"] = {
            "point_m": list(wall.point_m),
            "normal": list(wall.normal),
            "flatness_rms_m": wall.flatness_rms_m,
            "offset_std_m": wall.offset_std_m,
            "tilt_std_rad": wall.tilt_std_rad,
            "points": wall.points,
            "rms_px": wall.quality.reprojection_rms_px,
            "upper_edge": upper_edge(model.camera_optics.optics),
            "plumb": model.record.placement.plumb_px is not None,
        }
    return found


def lines(content: dict[str, Any]) -> list[str]:
    """The summary as sentences for a person."""
    text = []
    for name in ("camera", "projector"):
        if content.get(name):
            d = content[name]
            text.append(
                f"{name}: rms {d['rms_px']:.3f} px over {len(d['views'])} views, "
                f"distortion {d['distortion_model']}, "
                f"focal length {d['focal_px'][0]:.1f} ± {d['focal_std_px'][0]:.1f} px, "
                f"coverage {100 * d['coverage']:.0f} %"
            )
    if "stereo" in content:
        s = content["stereo"]
        text.append(f"camera and projector together: rms {s['rms_px']:.3f} px, {s['baseline_m']:.3f} m apart")
    if "wall" in content:
        w = content["wall"]
        text.append(
            f"wall: {w['points']} points, flat to {1e3 * w['flatness_rms_m']:.2f} mm, "
            f"distance ± {1e3 * w['offset_std_m']:.2f} mm, "
            f"tilt ± {math.degrees(w['tilt_std_rad']):.3f} degrees"
        )
        if w["upper_edge"] is not None:
            told = "" if w["plumb"] else "; if the camera hangs the other way up, give --plumb-px"
            text.append(f"up in the room: the picture's {w['upper_edge']} edge{told}")
    advice = [
        *content["issues"],
        *(a for n in ("camera", "projector") for a in (content.get(n) or {}).get("advice", [])),
    ]
    return text + [f"- {a}" for a in advice]


def _device(fit: Intrinsics, calibrated: CalibratedOptics, names: list[str]) -> dict[str, Any]:
    optics, std = calibrated.optics, np.sqrt(np.diag(calibrated.covariance_matrix()))
    return {
        "rms_px": fit.rms_px,
        "rms_all_points_px": fit.all_points_rms_px,
        "outliers": fit.outliers,
        "distortion_model": fit.model,
        "rms_by_model_px": fit.rms_by_model_px,
        "size_px": [optics.width_px, optics.height_px],
        "focal_px": list(optics.focal_px),
        "focal_std_px": std[:2].tolist(),
        "principal_px": list(optics.principal_px),
        "principal_std_px": std[2:4].tolist(),
        "distortion": list(optics.distortion),
        "position_m": list(optics.position_m),
        "position_std_m": std[12:].tolist(),
        "rotation_rad": list(optics.rotation_rad),
        "rotation_std_rad": std[9:12].tolist(),
        "coverage": calibrated.quality.coverage,
        "views": [{"name": n, "rms_px": r} for n, r in zip(names, fit.view_rms_px, strict=True)],
        "advice": list(calibrated.quality.advice),
    }


def _stereo(model: Model) -> dict[str, Any]:
    pair = model.pair
    if pair is None or model.projector_optics is None:
        return {}
    apart = np.subtract(model.projector_optics.optics.position_m, model.camera_optics.optics.position_m)
    return {
        "rms_px": pair.rms_px,
        "camera_rms_px": pair.adjusted.rms_px(pair.sightings, 0),
        "projector_rms_px": pair.adjusted.rms_px(pair.sightings, 1),
        "baseline_m": float(np.linalg.norm(apart)),
        "iterations": pair.adjusted.iterations,
        "converged": pair.adjusted.converged,
    }
