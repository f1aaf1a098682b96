"""How far the mean of a sequence of bursts is from that over a long time: as an error of the shifts, and in words."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.experiment.captures import CapturePair
from core.averaging import LEAST_BURSTS, ShortMean, short_mean
from core.motion import without_motion
from core.problem import ShiftMeasurement


def with_short_mean(
    shift: ShiftMeasurement, bursts: Sequence[ShiftMeasurement], captures: CapturePair
) -> tuple[ShiftMeasurement, str]:
    """The shift of a sequence's mean with the error of that mean, and a sentence on it; of one burst, as it is.

    `bursts` are how its bursts are shifted against the mean of all, in the windows of `shift`.
    """
    if not bursts:
        return shift, ""
    if len(bursts) < LEAST_BURSTS:
        return shift, (
            f" The flow is the mean of {len(bursts)} bursts: too few to tell how far such a mean is from that of a "
            f"long time. Take {LEAST_BURSTS} or more."
        )
    information = np.mean([burst.information_per_px2 for burst in bursts], axis=0)
    found = short_mean(np.stack([_still(burst, information) for burst in bursts]), information)
    if found.rms_px > 0.0:
        shift = replace(shift, short_mean_px=found.modes_px)
    return shift, _told(found, captures)


def _still(burst: ShiftMeasurement, information: np.ndarray) -> np.ndarray:
    """The shifts of a burst without what a motion of the camera explains."""
    if burst.motion is None:
        return burst.displacement_px
    motion = without_motion(burst.motion.at(burst.centres_px), information)
    return motion.apply(burst.displacement_px)


def _told(found: ShortMean, captures: CapturePair) -> str:
    starts_s = [float(burst.manifest["origin"]["sequence"]["began_s"]) for burst in captures.bursts]
    step_s = float(np.median([after - before for before, after in itertools.pairwise(starts_s)]))
    long_s = starts_s[-1] - starts_s[0] + step_s
    said = f" The flow is the mean of {len(starts_s)} bursts over {long_s:.0f} s."
    if found.rms_px == 0.0:
        return said + " They differ by no more than their noise."
    return (
        f"{said} The air moved: the mean is worth {found.independent:.1f} independent bursts, and its shifts lie "
        f"{1e3 * found.rms_px:.2f} thousandths of a pixel (rms) from those of a long time. The reconstruction counts "
        f"with that. For half of it, take {4 * long_s:.0f} s."
    )
