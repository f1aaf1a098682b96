"""The cameras of one capture: each takes its burst, and one that fails keeps none of the others from theirs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from app.capture.watched import BurstWatch, run_watched
from app.errors import AirlensError
from app.experiment.folder import Experiment
from app.experiment.views import view_names
from app.rig.conditions import Conditions, seconds_on
from app.rig.open import air_of, open_camera
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import OnFrame
from drivers.errors import DeviceError
from drivers.protocols import Camera


@dataclass(frozen=True)
class ViewBursts:
    """The bursts by the view's number, and by its name why nothing whole came of it; `errors` as they were raised."""

    bursts: Mapping[int, Burst]
    failed: Mapping[str, str]
    errors: tuple[Exception, ...] = field(default=(), repr=False)


def bursts_of_views(
    camera: Camera,
    experiment: Experiment,
    plan: CapturePlan,
    told: Conditions,
    watch: BurstWatch,
    keep: OnFrame,
    moment: int | None,
) -> ViewBursts:
    """The first view's burst by `camera`, which is open; then those of the others, whose cameras are opened in turn.

    `keep` gets the frames of the first. An abort ends them all.
    """
    names = view_names(experiment)
    bursts: dict[int, Burst] = {}
    failed: dict[str, str] = {}
    errors: list[Exception] = []
    for number, name in enumerate(names):
        if any(burst.outcome is BurstOutcome.ABORTED for burst in bursts.values()):
            failed[name] = "the capture was stopped before its turn"
            continue
        seconds = seconds_on(experiment.settings, told)
        try:
            if number == 0:
                burst = run_watched(camera, plan, watch, keep, seconds)
            else:
                with open_camera(experiment, air_of(plan.role), number, moment) as own:
                    burst = run_watched(own, plan, watch, lambda taken: None, seconds)
        except (AirlensError, DeviceError, OSError) as error:
            failed[name] = str(error)
            errors.append(error)
            continue
        bursts[number] = burst
        if burst.outcome is not BurstOutcome.COMPLETE:
            failed[name] = f"{burst.outcome.value} after {burst.frames} of {plan.frames} frames"
    return ViewBursts(bursts, failed, tuple(errors))


def together(bursts: Mapping[int, Burst], names: tuple[str, ...]) -> Burst:
    """The burst that stands for those of all views: one that ended early, else the first; the verdicts of all."""
    verdicts = [
        replace(verdict, name=f"{names[number]}: {verdict.name}")
        for number, burst in bursts.items()
        for verdict in burst.verdicts
    ]
    short = [burst for burst in bursts.values() if burst.outcome is not BurstOutcome.COMPLETE]
    return replace([*short, *bursts.values()][0], verdicts=tuple(verdicts))
