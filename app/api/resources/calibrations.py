"""Calibrations: what is known of camera, projector and wall, how well, and what to do about it."""

import numpy as np
from fastapi import APIRouter
from jaxtyping import Float

from app.api.models.calibrations import (
    CalibrationItem,
    CalibrationResource,
    NewCalibration,
    StandingResource,
)
from app.api.services import Given
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.calibrate.folder import StepName
from app.calibrate.parts import Part, bundle_of, is_calibrated, parts_of, ties_of
from app.experiment.folder import Experiment
from app.simulate.rehearsal import calibrate_simulated
from calibration.bundle import Bundle, CalibratedOptics
from core.geometry import Optics, face_of
from core.scene import Scene, View

router = APIRouter(tags=["calibrations"])

# What each part is called, and what stands in for it.
_WITHOUT = {
    StepName.camera: ("camera", "The optics written in experiment.toml are used."),
    StepName.projector: ("projector", "The optics written in experiment.toml are used."),
    StepName.wall: ("back wall", "The rig stands in a frame of its own, not yet in the room."),
    StepName.response: ("response", "The noise written in experiment.toml is used."),
}


@router.get("/experiments/{experiment}/calibration")
def read_calibration(given: Given, experiment: Identifier) -> CalibrationResource:
    """Return the calibration in use; of a rig that nobody has calibrated, that everything is missing."""
    return calibration_resource(given.folders.open(experiment))


@router.post("/experiments/{experiment}/calibration", status_code=201)
def calibrate(given: Given, experiment: Identifier, new: NewCalibration) -> CalibrationResource:
    """Calibrate a simulated rig, in one step."""
    found = given.folders.open(experiment)
    if found.settings.rig.camera_kind != new.kind:
        raise ApiError(
            "conflict", "This rig is real: its models come from images.", "Run `airlens calibrate` on it."
        )
    calibrate_simulated(found)
    given.ledger.append_event("experiment", {"experiment": experiment, "calibrated": True})
    return calibration_resource(found)


def calibration_resource(experiment: Experiment) -> CalibrationResource:
    """What is known of an experiment's rig, with what is missing. Raises BadInputError."""
    bundle, parts = bundle_of(experiment), parts_of(experiment)
    room, scene = experiment.settings.scene.room, experiment.settings.scene
    views = [(view, bundle.of(view.name, number == 0)) for number, view in enumerate(scene.views)]
    several = len(views) > 1
    items = [item for view, own in views for item in _items(own, view.name if several else "")]
    lacking = [_missing(part, name if several else "") for part in parts for name in part.lacking]
    return CalibrationResource(
        state="calibrated" if is_calibrated(parts) else "incomplete",
        date=bundle.date if experiment.bundle_path.is_file() else None,
        items=[*items, *lacking, *_ties(experiment)],
        room_m=[list(room.lower_m), list(room.upper_m)],
        rig=[standing for view, own in views for standing in _rig(own, view, scene, several)],
    )


def _rig(own: Bundle, view: View, scene: Scene, several: bool) -> list[StandingResource]:
    """A view's optics with the corners of their pictures on its wall: as calibrated, or the room's own."""
    wall, face = own.wall, face_of(view.wall)
    normal = np.zeros(3)
    normal[face.axis] = 1.0 if face.upper else -1.0
    point = np.array(
        (scene.room.upper_m if face.upper else scene.room.lower_m) if wall is None else wall.point_m
    )
    normal = normal if wall is None else np.array(wall.normal)
    projector = () if own.projector is None else (own.projector,)
    return [
        StandingResource(
            name=f"{one.name} of {view.name}" if several and one is own.projector else one.name,
            role="projector" if one is own.projector else "camera",
            position_m=list(one.optics.position_m),
            corners_m=corners_on(one.optics, point, normal),
        )
        for one in (*own.cameras, *projector)
    ]


def corners_on(
    optics: Optics, point_m: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"]
) -> list[list[float]]:
    """Where the picture's corners meet a plane; distortion is left out, for it bends no picture of a rig."""
    start = np.array(optics.position_m)
    found = []
    for u, v in ((0, 0), (optics.width_px, 0), (optics.width_px, optics.height_px), (0, optics.height_px)):
        ray = [
            (u - optics.principal_px[0]) / optics.focal_px[0],
            (v - optics.principal_px[1]) / optics.focal_px[1],
        ]
        direction = optics.rotation.T @ np.array([*ray, 1.0])
        ahead = float(normal @ direction)
        length = float(normal @ (point_m - start)) / ahead if abs(ahead) > 1e-6 else 1.0
        found.append([float(part) for part in start + length * direction])
    return found


def _items(own: Bundle, view: str) -> list[CalibrationItem]:
    """What is known of one view; `view` is named where there are several."""
    of = f" of {view}" if view else ""
    items = [_optics(one, one.name) for one in own.cameras]
    if own.projector is not None:
        items.append(_optics(own.projector, f"{own.projector.name}{of}"))
    if own.wall is not None:
        x, y, z = own.wall.point_m
        plane = f"plane through ({x:.3f}, {y:.3f}, {z:.3f}) m"
        items.append(
            CalibrationItem(
                name=f"wall{of}" if view else "back wall",
                state=own.wall.quality.source,
                value=plane,
                advice=_advice(own.wall.quality.advice),
            )
        )
    for response in own.camera_responses:
        value = f"dark {response.dark_counts:.1f} counts, {response.bits} bit"
        name, source = f"response of {response.name}", response.quality.source
        items.append(CalibrationItem(name=name, state=source, value=value, advice=""))
    return items


def _ties(experiment: Experiment) -> list[CalibrationItem]:
    """Whether several views were adjusted together."""
    tied = ties_of(experiment)
    if tied is None:
        return []
    advice = "" if tied.joint else "Adjust them together: airlens calibrate together."
    state = "measured" if tied.joint else "missing"
    return [CalibrationItem(name="views together", state=state, value=tied.text, advice=advice)]


def _missing(part: Part, view: str) -> CalibrationItem:
    name, standing = _WITHOUT[part.step]
    advice = f"{standing} Take the step '{part.step}'{'' if part.needed else ' where noise matters'}."
    called = f"{part.step} of {view}" if view else name
    return CalibrationItem(name=called, state="missing", value="not calibrated", advice=advice)


def _optics(one: CalibratedOptics, name: str) -> CalibrationItem:
    quality = one.quality
    focal_px = one.optics.focal_px[0]
    known = (
        "given, not measured"
        if quality.source == "given"
        else f"residual {quality.reprojection_rms_px:.3f} px over {quality.views} views, "
        f"{100 * quality.coverage:.0f} % of the image covered"
    )
    return CalibrationItem(
        name=name,
        state=quality.source,
        value=f"focal length {focal_px:.1f} px; {known}",
        advice=_advice(quality.advice),
    )


def _advice(advice: tuple[str, ...]) -> str:
    return " ".join(advice) or "Nothing to do."
