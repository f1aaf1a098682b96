"""What of a view is calibrated with the view itself, where another view's camera takes its pictures."""

from app.calibrate.folder import CalibrationFolder, StepName
from app.errors import BadInputError


def check_own(calibration: CalibrationFolder, view: str, step: StepName) -> None:
    """Refuse a step that is the camera's, for a view whose camera is another's, and its projector before that camera.

    Raises BadInputError.
    """
    owner = calibration.owner(view)
    if owner is None:
        return
    if step is StepName.projector and any(one.name == owner for one in calibration.bundle().cameras):
        return
    if step is StepName.projector:
        raise BadInputError(
            f"The pictures of {view!r} are taken by the camera of {owner!r}, which is not calibrated yet. Calibrate "
            f"it first: airlens calibrate camera {calibration.experiment.name} --view {_quoted(owner)}."
        )
    raise BadInputError(
        f"The pictures of {view!r} are taken by the camera of {owner!r}, whose step '{step}' serves both. Calibrate "
        f"{owner!r}: airlens calibrate {step} {calibration.experiment.name} --view {_quoted(owner)}. Of {view!r} "
        f"itself there is its projector: airlens calibrate projector {calibration.experiment.name} --view "
        f"{_quoted(view)}."
    )


def _quoted(name: str) -> str:
    return f'"{name}"' if " " in name else name
