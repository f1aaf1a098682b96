"""Reference, flow, reference: the second reference tells how far the camera moved meanwhile."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

from app.capture.burst import TakenBurst, take
from app.capture.watched import BurstWatch
from app.errors import AirlensError
from app.experiment.captures import newest_pair
from app.experiment.folder import Experiment, new_id
from app.reconstruct.measure import between_references
from app.reconstruct.problem import known_of
from app.rig.conditions import UNTOLD, Conditions
from drivers.burst import CapturePlan, CaptureRole
from drivers.protocols import Camera

# The bursts in their order. `take_series` gives each its place as `series.place` in its manifest.
PLACES: tuple[CaptureRole, ...] = ("reference", "flow", "reference")
_UNWATCHED = BurstWatch()

# Opens the camera for the burst at a place of the series.
Opens = Callable[[CaptureRole, int], AbstractContextManager[Camera]]


@dataclass(frozen=True)
class Series:
    """Three bursts, and what their references say of the camera; nothing where the series was stopped."""

    taken: tuple[TakenBurst, ...]
    said: str
    agree: bool


def take_series(
    opens: Opens,
    experiment: Experiment,
    plan: CapturePlan,
    settle_s: tuple[float, float] = (0.0, 0.0),
    told: Conditions = UNTOLD,
    watch: BurstWatch = _UNWATCHED,
    ready: Callable[[CaptureRole, int], object] = lambda role, place: None,
    at_once: bool = False,
) -> Series:
    """Take the three bursts; `settle_s` is waited before the flow, and before the second reference.

    `ready` is called before each burst, when the operator may change the air; `at_once` is as in `take`. Raises
    AirlensError for a burst that is not whole: what was taken stays.
    """
    name = new_id(experiment.captures_folder, "series")
    taken: list[TakenBurst] = []
    for place, role in enumerate(PLACES):
        ready(role, place)
        wait_s = settle_s[place - 1] if place else plan.settle_s
        own = replace(plan, role=role, settle_s=wait_s)
        with opens(role, place) as camera:
            where = {"id": name, "place": place, "began_s": time.time()}
            one = take(camera, experiment, own, told, watch, series=where, moment=place, at_once=at_once)
            taken.append(one)
        if taken[-1].shortfall:
            raise AirlensError(f"The series ended with its burst {place + 1} of 3. {taken[-1].shortfall}")
    found = between_references(newest_pair(experiment), known_of(experiment).scene)
    return Series(tuple(taken), found.said, found.agree)
