"""How far the mean of a sequence of bursts is from that over a long time: as an error of the shifts, and in words."""

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.experiment.captures import Capture, CapturePair, load_capture
from core.averaging import LEAST_BURSTS, ShortMean, short_mean
from core.displacement import measure_shift
from core.problem import ShiftMeasurement

Variance = Callable[[Capture], Float[np.ndarray, "rows cols"]]


def with_short_mean(
    shift: ShiftMeasurement, captures: CapturePair, view: int, variance: Variance
) -> tuple[ShiftMeasurement, str]:
    """The shift of a sequence's mean with the error of that mean, and a sentence on it; of one burst, as it is.

    `variance` is that of the pixels of a capture's mean picture. Raises BadInputError.
    """
    if not captures.bursts:
        return shift, ""
    if len(captures.bursts) < LEAST_BURSTS:
        return shift, (
            f" The flow is the mean of {len(captures.bursts)} bursts: too few to tell how far such a mean is from "
            f"that of a long time. Take {LEAST_BURSTS} or more."
        )
    found = short_mean(*_departures(shift, captures, view, variance))
    if found.rms_px > 0.0:
        shift = replace(shift, short_mean_px=found.modes_px)
    return shift, _told(found, captures)


def _departures(
    shift: ShiftMeasurement, captures: CapturePair, view: int, variance: Variance
) -> tuple[Float[np.ndarray, "bursts windows 2"], Float[np.ndarray, "windows 2 2"]]:
    """How each burst is shifted against the mean of all, in the windows of `shift`; information of one burst."""
    mean = captures.flow.images[view].mean
    departures, information = [], []
    for burst in captures.bursts:
        capture = load_capture(burst.folder)
        alone = measure_shift(
            mean, capture.images[view].mean, variance(capture), shift.window_px, follow=False
        )
        place = {tuple(centre): number for number, centre in enumerate(alone.centres_px)}
        chosen = [place[tuple(centre)] for centre in shift.centres_px]
        departures.append(alone.displacement_px[chosen])
        information.append(alone.information_per_px2[chosen])
    return np.stack(departures), np.mean(information, axis=0)


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
