"""Calibrations: what is known of camera, projector and wall, how well, and what to do about it."""

from typing import Literal

from fastapi import APIRouter

from app.api.problems import ApiError
from app.api.services import Given
from app.api.strict import Identifier, Strict
from app.experiment import Experiment
from app.rehearsal import calibrate_simulated
from calibration.bundle import Bundle, CalibratedOptics, from_json

router = APIRouter(tags=["calibrations"])


class CalibrationItem(Strict):
    """One thing that was calibrated, in words for the operator."""

    name: str
    value: str
    advice: str


class CalibrationResource(Strict):
    """The calibration of an experiment."""

    state: Literal["calibrated"] = "calibrated"
    date: str | None
    items: list[CalibrationItem]


class NewCalibration(Strict):
    """A simulated rig takes its models from its scene; a real one is calibrated on the command line."""

    kind: Literal["simulated"]


@router.get("/experiments/{experiment}/calibration")
def read_calibration(given: Given, experiment: Identifier) -> CalibrationResource:
    """Return the calibration in use."""
    return _resource(given.folders.open(experiment))


@router.post("/experiments/{experiment}/calibration", status_code=201)
def calibrate(given: Given, experiment: Identifier, new: NewCalibration) -> CalibrationResource:
    """Calibrate a simulated rig, in one step."""
    found = given.folders.open(experiment)
    if found.settings.rig.camera.kind != new.kind:
        raise ApiError(
            "conflict", "This rig is real: its models come from images.", "Run `airlens calibrate` on it."
        )
    calibrate_simulated(found)
    given.ledger.append_event("experiment", {"experiment": experiment, "calibrated": True})
    return _resource(found)


def _resource(experiment: Experiment) -> CalibrationResource:
    if not experiment.bundle_path.is_file():
        raise ApiError("not_found", "This experiment is not calibrated.", "Calibrate it.")
    bundle = from_json(experiment.bundle_path.read_text(encoding="utf-8"))
    return CalibrationResource(date=bundle.date, items=_items(bundle))


def _items(bundle: Bundle) -> list[CalibrationItem]:
    projector = () if bundle.projector is None else (bundle.projector,)
    items = [_optics(one) for one in (*bundle.cameras, *projector)]
    if bundle.wall is not None:
        x, y, z = bundle.wall.point_m
        plane = f"plane through ({x:.3f}, {y:.3f}, {z:.3f}) m"
        items.append(
            CalibrationItem(name="back wall", value=plane, advice=_advice(bundle.wall.quality.advice))
        )
    for response in bundle.camera_responses:
        value = f"dark {response.dark_counts:.1f} counts, {response.bits} bit"
        items.append(CalibrationItem(name=f"response of {response.name}", value=value, advice=""))
    return items


def _optics(one: CalibratedOptics) -> CalibrationItem:
    quality = one.quality
    focal_px = one.optics.focal_px[0]
    known = (
        "given, not measured"
        if quality.source == "given"
        else f"residual {quality.reprojection_rms_px:.3f} px over {quality.views} views, "
        f"{100 * quality.coverage:.0f} % of the image covered"
    )
    return CalibrationItem(
        name=one.name, value=f"focal length {focal_px:.1f} px; {known}", advice=_advice(quality.advice)
    )


def _advice(advice: tuple[str, ...]) -> str:
    return " ".join(advice) or "Nothing to do."
