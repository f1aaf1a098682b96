"""What a burst's own frames cannot tell: is it fit for this experiment's calibration and reference?

Adds verdicts to those of the burst: a colour sensor's mosaic, the calibration's age and conditions, and for a flow
whether its settings are the reference's and how far the still border moved since.
"""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from app.capture.mosaic import judge_mosaic
from app.errors import AirlensError
from app.experiment.calibration import read_bundle
from app.experiment.captures import MAX_SETTING_OFF, Capture, CapturePair, load_capture
from app.experiment.folder import Experiment
from app.rig.conditions import UNTOLD, Conditions, conditions_in, conditions_of
from calibration.age import warnings_for
from drivers.burst import Burst
from drivers.quick_look import quick_look
from drivers.verdict import Verdict

# Beyond this the drift that the reconstruction takes out leaves traces of the pattern's own structure.
MAX_DRIFT_PX = 1.0


def judged(experiment: Experiment, burst: Burst, told: Conditions = UNTOLD, view: int = 0) -> Burst:
    """The burst of a view with what the experiment says about it."""
    if burst.frames == 0:
        return burst
    return replace(
        burst,
        verdicts=(
            *burst.verdicts,
            *_mosaic(burst),
            *_calibration(experiment, told),
            *_against_reference(experiment, burst, view),
        ),
    )


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
        known = conditions_in(capture.manifest.get("origin", {}))
        for text in calibration_warnings(experiment, capture.manifest["created"], known):
            found[f"The {capture.role} capture: {text}"] = None
    return tuple(found)


def _mosaic(burst: Burst) -> tuple[Verdict, ...]:
    """Whether the pattern's picture is as a colour sensor has it; of a dark or flat picture no shift is measured."""
    return judge_mosaic(burst.mean) if burst.plan.role in ("reference", "flow") else ()


def _calibration(experiment: Experiment, told: Conditions) -> list[Verdict]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    found = calibration_warnings(experiment, now, told)
    expected = "a calibration as old and as warm as the capture"
    return [Verdict("calibration", False, float(len(found)), expected, text) for text in found]


def _against_reference(experiment: Experiment, burst: Burst, view: int) -> list[Verdict]:
    """What a flow must share with the newest reference, if there is one: its settings, and a still border."""
    if burst.plan.role != "flow":
        return []
    try:
        reference = load_capture(experiment.latest_capture("reference"))
    except AirlensError:
        return []
    if len(reference.images) <= view:
        return []
    return [*_settings(reference, burst, view), *_drift(reference.images[view].mean, burst)]


def _settings(reference: Capture, burst: Burst, view: int) -> list[Verdict]:
    """Exposure and gain as the reference had them; how much they differ, as a part of the reference's."""
    before = {one["name"]: one["granted"] for one in reference.manifest["views"][view]["settings"]}
    found = []
    for one in burst.settings:
        was = before.get(one.name)
        if was is None or one.granted is None:
            continue
        off = abs(one.granted - was) / max(abs(was), 1e-9)
        found.append(
            Verdict(
                f"{one.name} of the reference",
                off <= MAX_SETTING_OFF,
                off,
                f"{was:g} as in the reference",
                f"It was {one.granted:g}. Take both with the same setting: another one changes the picture.",
            )
        )
    return found


def _drift(reference: np.ndarray, burst: Burst) -> list[Verdict]:
    """How far the border moved since the reference."""
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
