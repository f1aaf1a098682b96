"""Take one capture of an experiment with its rig: the same code for a real and a simulated rig."""

from pathlib import Path

from app.capture.checks import judged, noted
from app.errors import AirlensError
from app.experiment.captures import CaptureRecorder
from app.experiment.folder import Experiment, new_id
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, Conditions, seconds_on
from app.rig.open import AirState, open_camera
from drivers.burst import BurstOutcome, CapturePlan
from drivers.capture import Abort, OnProgress, run_capture


def acquire(
    experiment: Experiment,
    plan: CapturePlan,
    on_progress: OnProgress | None = None,
    abort: Abort | None = None,
    *,
    air: AirState | None = None,
    told: Conditions = UNTOLD,
) -> Path:
    """Run `plan` and return the capture's folder, finished.

    `air` tells a simulated room what to do; by default it moves in flow captures only. Raises AirlensError
    when the burst was cut short (what was taken is kept, marked as incomplete) and DeviceError.
    """
    state: AirState = air or ("moving" if plan.kind == "flow" else "still")
    with open_camera(experiment, state) as camera:
        check_room(experiment.folder, plan, camera.info)
        folder = experiment.captures_folder / new_id(experiment.captures_folder, plan.kind)
        recorder = CaptureRecorder(folder, plan)
        burst = run_capture(
            camera,
            plan,
            on_progress,
            on_frame=recorder.observe,
            abort=abort,
            rig_on_s=seconds_on(experiment.settings, told),
        )
        burst = judged(experiment, burst, told)
        origin = {"rig": experiment.settings.rig.camera_kind, "air": state} | noted(experiment, told)
        recorder.keep(burst, origin=origin)
    if burst.outcome is not BurstOutcome.COMPLETE:
        raise AirlensError(
            f"The {plan.kind} capture ended early ({burst.outcome.value}) after {burst.frames} of "
            f"{plan.frames} frames; they are kept in {folder}, marked as incomplete. Take it again."
        )
    return folder
