"""What a burst's own frames cannot tell: is it fit for this experiment's calibration and reference?

Adds verdicts to those of the burst: the calibration's age and conditions, and for a flow how far the still
border moved since the reference.
"""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from app.errors import AirlensError
from app.experiment.calibration import read_bundle
from app.experiment.captures import CapturePair, load_capture
from app.experiment.folder import Experiment
from app.rig.conditions import UNTOLD, Conditions, conditions_of
from calibration.handover import warnings_for
from drivers.burst import Burst
from drivers.quick_look import quick_look
from drivers.verdict import Verdict

# Beyond this the drift that the reconstruction takes out leaves traces of the pattern's own structure.
MAX_DRIFT_PX = 1.0


def judged(experiment: Experiment, burst: Burst, told: Conditions = UNTOLD) -> Burst:
    """The burst with what the experiment says about it."""
    if burst.frames == 0:
        return burst
    return replace(
        burst, verdicts=(*burst.verdicts, *_calibration(experiment, told), *_drift(experiment, burst))
    )


def noted(experiment: Experiment, told: Conditions) -> dict[str, Any]:
    """The conditions as they go into a capture's manifest; absent where nobody knows."""
    known = conditions_of(experiment.settings, told)
    pairs = {"ambient_temperature_k": known.ambient_temperature_k, "minutes_on": known.minutes_on}
    return {name: value for name, value in pairs.items() if value is not None}


def calibration_warnings(experiment: Experiment, captured: str, told: Conditions) -> tuple[str, ...]:
    """Why a capture of that moment may not fit the calibration; nothing where there is none yet."""
    try:
        bundle = read_bundle(experiment.folder)
    except AirlensError as error:
        return (str(error),)
    if bundle is None:
        return ()
    known = conditions_of(experiment.settings, told)
    return warnings_for(bundle, captured, known.ambient_temperature_k, known.minutes_on)


def aged(experiment: Experiment, captures: CapturePair) -> tuple[str, ...]:
    """Why these captures may not fit the calibration, by what their manifests noted."""
    found: dict[str, None] = {}
    for capture in (captures.reference, captures.flow):
        origin = capture.manifest.get("origin", {})
        told = Conditions(origin.get("ambient_temperature_k"), origin.get("minutes_on"))
        for text in calibration_warnings(experiment, capture.manifest["created"], told):
            found[f"The {capture.role} capture: {text}"] = None
    return tuple(found)


def _calibration(experiment: Experiment, told: Conditions) -> list[Verdict]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    found = calibration_warnings(experiment, now, told)
    expected = "a calibration as old and as warm as the capture"
    return [Verdict("calibration", False, float(len(found)), expected, text) for text in found]


def _drift(experiment: Experiment, burst: Burst) -> list[Verdict]:
    """How far the border moved since the newest reference, if this is a flow and there is one."""
    if burst.plan.kind != "flow":
        return []
    try:
        reference = load_capture(experiment.latest_capture("reference")).images[0].mean
    except AirlensError:
        return []
    if reference.shape != burst.mean.shape:
        return []
    columns, rows = quick_look(reference, burst.mean).drift_px
    drift_px = float((columns**2 + rows**2) ** 0.5)
    return [
        Verdict(
            "border drift",
            drift_px <= MAX_DRIFT_PX,
            drift_px,
            f"the still border within {MAX_DRIFT_PX:g} px of the reference",
            f"The picture moved by {columns:+.2f}, {rows:+.2f} px since the reference. Find what moved "
            "(camera, projector's fan, a table), then take reference and flow again.",
        )
    ]
