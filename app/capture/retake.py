"""One camera's picture of a capture taken again, alone; those of the other cameras stay.

A capture that lacks a view is completed where it is. Of one that is whole a new one is made, with the other views'
pictures as they are: what was kept is never altered.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.capture.burst import CAMERAS, TakenBurst, origin_of
from app.capture.checks import judged
from app.capture.watched import UNWATCHED, BurstWatch, run_watched
from app.errors import BadInputError
from app.experiment.capture_parts import CaptureParts, carry_over, parts_of
from app.experiment.folder import Experiment, finished, new_id
from app.experiment.recorder import CaptureRecorder
from app.experiment.views import view_names, view_number
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, Conditions, seconds_on
from app.rig.lamps import Lamps
from drivers.burst import BurstOutcome
from drivers.protocols import Camera


def to_retake(experiment: Experiment, capture: str | None, view: str | None) -> tuple[CaptureParts, int]:
    """The capture of that name, by default the newest, and the number of the view: by default the one it lacks.

    Raises BadInputError, also for a burst of a sequence or series that is whole: these are taken anew.
    """
    folder = experiment.captures_folder / capture if capture else _newest(experiment)
    if not folder.is_dir():
        raise BadInputError(f"{experiment.folder} has no capture {capture!r}.")
    parts = parts_of(folder, view_names(experiment))
    if parts.origin.get("rig") == "imported":
        raise BadInputError(f"The pictures of {folder.name} were imported: import those of that view again.")
    if view is None and len(parts.missing) == 1:
        view = parts.missing[0]
    number = view_number(experiment, view)
    if not parts.missing and {"sequence", "series"} & set(parts.origin):
        raise BadInputError(
            f"{folder.name} is one of several bursts that belong together. Take the sequence or series again."
        )
    return parts, number


def retake(
    camera: Camera,
    experiment: Experiment,
    parts: CaptureParts,
    number: int,
    told: Conditions = UNTOLD,
    watch: BurstWatch = UNWATCHED,
    name: str | None = None,
    lamps: Lamps | None = None,
) -> TakenBurst:
    """Take the burst of one view by its camera, as the capture asked for it, into the folder of `name_of_retake`.

    `lamps` are as in `take`.
    Raises AirlensError, DeviceError.
    """
    plan, whole = parts.plan, not parts.missing
    check_room(experiment.folder, plan, camera.info)
    (lamps or Lamps(experiment)).light(number)
    folder = experiment.captures_folder / (name or name_of_retake(experiment, parts))
    recorder = CaptureRecorder(folder, plan)
    watch.begun(folder)
    try:
        burst = run_watched(camera, plan, watch, recorder.observe, seconds_on(experiment.settings, told))
        if burst.outcome is not BurstOutcome.COMPLETE:
            if whole:
                recorder.discard()
            return TakenBurst(burst, None if whole else recorder.keep_short(burst))
        if whole:
            carry_over(parts, folder, number)
        burst = judged(experiment, burst, told, number)
        origin = dict(parts.origin) or origin_of(experiment, plan)
        origin.pop(CAMERAS, None)  # taken alone, at another time
        if whole:
            origin["retaken"] = {"view": parts.names[number], "of": parts.folder.name}
        missing = recorder.keep_views({number: burst}, parts.names, origin)
        return TakenBurst(burst, folder, dict.fromkeys(missing, "its turn is to come"))
    except BaseException:
        recorder.leave()
        raise


def name_of_retake(experiment: Experiment, parts: CaptureParts) -> str:
    """The capture's own name where it lacks a view, else a new one."""
    return parts.folder.name if parts.missing else new_id(experiment.captures_folder, parts.plan.role)


def may_retake(parts: CaptureParts) -> bool:
    """Whether one view of it can be taken alone: of several, by this rig, and not of bursts that belong together."""
    several = len(parts.names) > 1 and parts.origin.get("rig") != "imported"
    return several and bool(parts.missing or not {"sequence", "series"} & set(parts.origin))


def place_of(origin: Mapping[str, Any]) -> int | None:
    """The place in a series of the capture that came from there; none outside a series."""
    place = origin.get("series", {}).get("place")
    return None if place is None else int(place)


def _newest(experiment: Experiment) -> Path:
    """The newest capture that is whole or has at least one view's picture. Raises BadInputError."""
    parent = experiment.captures_folder
    begun = {path.parent for path in parent.glob("[!.]*/part-*.json")}
    found = sorted({*finished(parent), *begun})
    if not found:
        raise BadInputError(f"{experiment.folder} has no capture of which a view could be taken again.")
    return found[-1]
