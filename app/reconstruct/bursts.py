"""The bursts of a sequence, each against the mean of all: measured one after the other, and kept as they come."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from app.errors import BadInputError
from app.experiment.captures import Capture, CapturePair, load_capture
from app.experiment.shift_files import as_bytes, of_bytes
from app.reconstruct.pair import check_light
from core.checkpoint import digest
from core.problem import ShiftMeasurement
from core.scene import Scene
from core.watch import Watch

# A burst that shows something else than the pattern in so much of the picture is no picture of the wall.
_MOST_REFUSED = 0.5


def burst_shifts(
    scene: Scene,
    index: int,
    captures: CapturePair,
    shift: ShiftMeasurement,
    alone: Callable[[Capture], ShiftMeasurement],
    watch: Watch,
) -> tuple[ShiftMeasurement, tuple[ShiftMeasurement, ...], str]:
    """The shift of a view's mean and those of its bursts, in the windows that all can believe, and a sentence on it.

    `alone` measures how the pattern moved from the mean picture to a burst, in all windows. What `watch.store` knows
    is not measured again. Raises BadInputError for a burst that does not show the wall, StoppedError.
    """
    bursts, among = [], partial(windows_among, chosen_px=shift.centres_px)
    pictures = tuple((name, file["sha256"]) for name, file in sorted(captures.inputs.items()))
    for number, kept in enumerate(captures.bursts):
        watch.check_stop()
        watch.tell({"doing": f"measure burst {number + 1} of {len(captures.bursts)}"})
        name = f"burst-{digest(scene, index, number, pictures)}"
        content = None if watch.store is None else watch.store.get(name)
        if content is None:
            burst = load_capture(kept.folder)
            check_light(captures.reference, burst, index)
            found = alone(burst)
            if watch.store is not None:
                watch.store[name] = as_bytes(found)
        else:
            found = of_bytes(content)
        found = found.at(among(found.centres_px))
        _check_shows_wall(found, kept)
        bursts.append(found)
    if not bursts:
        return shift, (), ""
    good = np.all([~_refused(burst) for burst in bursts], axis=0)
    return shift.at(good), tuple(burst.at(good).good() for burst in bursts), _told(good)


def windows_among(
    centres_px: Float[np.ndarray, "windows 2"], chosen_px: Float[np.ndarray, "some 2"]
) -> Bool[np.ndarray, " windows"]:
    """Which windows are among the chosen; both are in the picture's order."""
    chosen = {tuple(centre) for centre in chosen_px}
    return np.array([tuple(centre) in chosen for centre in centres_px])


def _refused(shift: ShiftMeasurement) -> Bool[np.ndarray, " windows"]:
    return np.zeros(len(shift.centres_px), bool) if shift.refused is None else shift.refused


def _check_shows_wall(shift: ShiftMeasurement, burst: Capture) -> None:
    refused = float(_refused(shift).mean())
    if refused > _MOST_REFUSED:
        raise BadInputError(
            f"{burst.folder.name}: {100 * refused:.0f} % of its windows show something else than the pattern in the "
            "other bursts of the sequence; expected hardly any. Did somebody walk through the picture, or was the "
            f"camera pushed? Take the sequence again; or move {burst.folder.name} out of captures/ and reconstruct "
            "without this burst."
        )


def _told(good: Bool[np.ndarray, " windows"]) -> str:
    if good.all():
        return ""
    return (
        f" {100 * float(1.0 - good.mean()):.3g} % of the windows show something else than the pattern, moved, in one "
        "of the bursts (somebody who walked by), and are left out of all of them."
    )
