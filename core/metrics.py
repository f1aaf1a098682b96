"""The project's yardstick: errors of a solution against a known volume, beside the trivial answers.

All on the truth's vertices. The three walls with a thermal layer inside the first cell (x max, y min,
y max) are left out, since no smooth field can follow it. Departures are from the mean at each height:
most of T - T0 is a bulk offset and a stratification, which flatter any answer. Vertices where the truth is NaN
(objects, which hold no air) count nowhere.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

Volume = Float[np.ndarray, "nx ny nz"]
Vectors = Float[np.ndarray, "nx ny nz 3"]

# Where speed exceeds this fraction of the supply speed is called the jet.
JET_FRACTION = 0.2


def inner(volume: np.ndarray) -> np.ndarray:
    """Without the planes x max, y min, y max."""
    return volume[:-1, 1:-1]


def off_walls(volume: np.ndarray) -> np.ndarray:
    """Without the planes of all six walls."""
    return volume[1:-1, 1:-1, 1:-1]


def rms(values: np.ndarray) -> float:
    """Root mean square; of vectors, of their length."""
    squares = np.square(values, dtype=np.float64)
    return float(np.sqrt(mean_of_air(squares.sum(-1) if values.ndim == 4 else squares)))


def mean_of_air(values: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Any:
    """Mean of what is not NaN, axes kept unless all are meant; 0 where all is."""
    air = ~np.isnan(values)
    kept = axis is not None
    total = np.where(air, values, 0).sum(axis=axis, keepdims=kept)
    return total / np.maximum(air.sum(axis=axis, keepdims=kept), 1)


def departure(volume: Volume) -> Volume:
    """Departure from the mean at each height."""
    return volume - mean_of_air(volume, axis=(0, 1))


def ratio(numerator: float, denominator: float) -> float | None:
    """A relative error, or None where the truth is zero."""
    return numerator / denominator if denominator > 0 else None


def score_temperature(found_k: Volume, truth_k: Volume, ambient_k: float) -> dict[str, Any]:
    """rms error in K, relative to the departure from each height's mean, and the trivial answers in K.

    `air` is the error without the planes of all walls. Vertices on a wall have the temperature of its surface, which
    may differ from the air's by degrees.
    """
    truth = inner(truth_k)
    y_mean = np.broadcast_to(mean_of_air(truth, axis=1), truth.shape)
    scale = rms(departure(truth))
    error = rms(inner(found_k) - truth)
    return {
        "rms_K": error,
        "air": {
            "rms_K": rms(off_walls(found_k - truth_k)),
            "inlet_plane": rms(off_walls(truth_k[:1] - truth_k)),
        },
        "rel_departure": ratio(error, scale),
        "departure_of_departures": ratio(rms(departure(inner(found_k)) - departure(truth)), scale),
        "trivial": {
            "ambient": rms(ambient_k - truth),
            "inlet_plane": rms(truth[:1] - truth),
            "y_mean": rms(y_mean - truth),
        },
    }


def score_velocity(found_m_s: Vectors, truth_m_s: Vectors, supply_m_s: float) -> dict[str, Any]:
    """rms error relative to the rms of u (u = 0 scores 1), everywhere, in the jet, and outside it."""
    truth, found = inner(truth_m_s), inner(found_m_s)
    jet = np.linalg.norm(truth, axis=-1) > JET_FRACTION * supply_m_s

    def relative(mask: np.ndarray) -> float | None:
        if not mask.any():
            return None
        error = np.linalg.norm((found - truth)[mask], axis=-1)
        return ratio(rms(error), rms(np.linalg.norm(truth[mask], axis=-1)))

    return {
        "rel": relative(np.ones_like(jet)),
        "jet_rel": relative(jet),
        "outside_jet_rel": relative(~jet),
        "trivial": {"zero": 1.0, "inlet_plane": ratio(rms(truth[:1] - truth), rms(truth))},
    }


def score_pressure(found: Volume, truth: Volume) -> dict[str, Any]:
    """rms error relative to the rms of p, both about their mean (p is known up to a constant)."""
    t, f = (inner(v) - mean_of_air(inner(v)) for v in (truth, found))
    plane = t[:1] - t
    return {
        "rel": ratio(rms(f - t), rms(t)),
        "rel_departure": ratio(rms(departure(f) - departure(t)), rms(departure(t))),
        "trivial": {"inlet_plane": ratio(rms(plane - mean_of_air(plane)), rms(t)), "zero": 1.0},
    }
