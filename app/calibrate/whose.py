"""What of a view is calibrated with the view itself, where another view's camera takes its pictures."""

import shlex

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
    folder = shlex.quote(calibration.experiment.name)
    if step is StepName.projector:
        raise BadInputError(
            f"The pictures of {view!r} are taken by the camera of {owner!r}, which is not calibrated yet. Calibrate "
            f"it first: airlens calibrate camera {folder} --view {shlex.quote(owner)}."
        )
    raise BadInputError(
        f"The pictures of {view!r} are taken by the camera of {owner!r}, whose step '{step}' serves both. Calibrate "
        f"{owner!r}: airlens calibrate {step} {folder} --view {shlex.quote(owner)}. Of {view!r} "
        f"itself there is its projector: airlens calibrate projector {folder} --view "
        f"{shlex.quote(view)}."
    )
