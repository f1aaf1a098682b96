"""A burst that somebody watches, and may end."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from drivers.burst import Burst, CapturePlan
from drivers.capture import OnFrame, OnProgress, Taken, run_capture
from drivers.protocols import Camera

OnAbort = Literal["keep", "discard"]


@dataclass(frozen=True)
class BurstWatch:
    """Who follows a burst: hears of every frame, and ends it by saying what becomes of the frames so far.

    `frame` hears of the number of the view that took it as well. `begun` hears of the folder of every new capture.
    `kept` hears of it once its burst is whole on the disk.
    """

    progress: OnProgress | None = None
    frame: Callable[[Taken, int], object] | None = None
    stop: Callable[[], OnAbort | None] = lambda: None
    begun: Callable[[Path], object] = lambda folder: None
    kept: Callable[[Path], object] = lambda folder: None


UNWATCHED = BurstWatch()


def run_watched(
    camera: Camera,
    plan: CapturePlan,
    watch: BurstWatch,
    keep: OnFrame,
    rig_on_s: float | None,
    view: int = 0,
    ready: Callable[[], object] | None = None,
) -> Burst:
    """Take a burst; `keep` gets every good frame before the watch does; `ready` is as in `run_capture`.

    Raises DeviceError.
    """

    def follow(taken: Taken) -> None:
        keep(taken)
        if watch.frame is not None:
            watch.frame(taken, view)

    return run_capture(
        camera,
        plan,
        watch.progress,
        on_frame=follow,
        abort=lambda: watch.stop() is not None,
        rig_on_s=rig_on_s,
        ready=ready,
    )
