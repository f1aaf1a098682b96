"""A sequence of bursts as a result: the mean room, and the temperature of each burst as a departure from it."""

from dataclasses import replace

import numpy as np

from app.errors import BadInputError
from app.experiment.captures import CapturePair
from app.reconstruct.measure import Measurement
from core.result import Departures, Solution
from core.solve.sequence.departures import LEAST_BURSTS, solve_departures
from core.watch import Watch


def check_sequence(captures: CapturePair) -> None:
    """Raise BadInputError where the newest flow is no sequence of enough bursts."""
    if len(captures.bursts) < LEAST_BURSTS:
        raise BadInputError(
            f"The newest flow has {max(len(captures.bursts), 1)} burst(s); expected a sequence of at least "
            f"{LEAST_BURSTS}. Take one: airlens capture flow EXPERIMENT --bursts 16 --every-s 6. Or reconstruct "
            "without --sequence."
        )


def with_departures(solution: Solution, measurement: Measurement, watch: Watch) -> Solution:
    """The solution of a sequence's mean with its bursts' departures, and a sentence on them. Raises StoppedError."""
    scene = measurement.scene
    found = solve_departures(scene, solution, measurement.bursts, _began_s(measurement.captures), watch)
    whole = replace(solution, departures=found, notes=(*solution.notes, _told(found)))
    return whole.without_objects(scene.objects)


def _began_s(captures: CapturePair) -> np.ndarray:
    """When each burst began, from the first one on [s]."""
    began_s = [float(burst.manifest["origin"]["sequence"]["began_s"]) for burst in captures.bursts]
    return np.array(began_s) - began_s[0]


def _told(found: Departures) -> str:
    moved, unknown = np.nanmean(found.temperature_k**2), np.nanmean(found.temperature_std_k**2)
    told = 100 * float(moved / (moved + unknown))
    return (
        f"From burst to burst the temperature departs from the mean by {found.field_std_k:.2g} K (rms), over "
        f"lengths of some {found.field_length_m:.2g} m. The pictures tell {told:.0f} % of the "
        "variance of such departures: one view does not see where along it they stand. The velocity of single bursts "
        "is not solved for."
    )
