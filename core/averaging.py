"""How well a mean over a short time is known: from how bursts of moving air differ from their mean.

The mean of n bursts of air that moves differs from the mean over a long time. In the shifts d of the windows, the
bursts' departures from their mean say by how much and in which patterns:

    C = S t / n,    t = 1 + 2 sum_k (1 - k/n) g_k / g_0,

with S the covariance of the bursts, g_k their covariance k bursts apart, summed over the windows and to the first
lag that is not positive (Geyer 1992, the initial positive sequence). The departures are from the bursts' own mean, so
that each g_k is found too small by g_0 t / n (Anderson 1971, 8.2): both are solved for together. The bursts' noise is
known and is taken out of S.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Fewer bursts than this say nothing of how their mean scatters.
LEAST_BURSTS = 3
# A mean of correlated bursts is never taken to be known from less than this many independent ones.
_LEAST_INDEPENDENT = 1.5
_ROUNDS = 30


@dataclass(frozen=True)
class ShortMean:
    """What is not known of a mean over bursts.

    The columns of `modes_px` are independent errors of one standard deviation. `independent` is how many independent
    bursts the mean is worth.
    """

    modes_px: Float[np.ndarray, "windows 2 modes"]
    independent: float

    @property
    def rms_px(self) -> float:
        """Standard deviation of a window's shift along one axis: root mean square over the windows."""
        return float(np.sqrt((self.modes_px**2).sum(axis=-1).mean()))


def short_mean(
    departures_px: Float[np.ndarray, "bursts windows 2"],
    information_per_px2: Float[np.ndarray, "windows 2 2"],
) -> ShortMean:
    """The error of a mean of bursts at even times, from their departures and the information of a single burst.

    Raises ValueError for fewer than LEAST_BURSTS bursts.
    """
    bursts = len(departures_px)
    if bursts < LEAST_BURSTS:
        raise ValueError(f"{bursts} bursts; expected at least {LEAST_BURSTS}.")
    departures_px = departures_px - departures_px.mean(axis=0)
    values, vectors = np.linalg.eigh(information_per_px2)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.transpose(0, 2, 1)
    white = np.einsum("wab,nwb->nwa", root, departures_px).reshape(bursts, -1)
    products = white @ white.T
    noise = float(np.count_nonzero(values > 0))
    spread, weights = np.linalg.eigh(products / (bursts - 1))
    # Of noise alone, each of the n - 1 values is the number of its components over n - 1.
    left = np.maximum(spread - noise / (bursts - 1), 0.0)
    found = left > 1e-9 * noise
    if not found.any():
        return ShortMean(np.zeros((*departures_px.shape[1:], 0)), float(bursts))
    covariance = np.array([np.trace(products, offset=lag) / (bursts - lag) for lag in range(bursts)])
    covariance += noise / bursts
    covariance[0] -= noise
    total, independent = _of_mean(covariance)
    scale = np.sqrt(left[found] / spread[found] / (bursts - 1) * total / left[found].sum())
    return ShortMean(np.einsum("nwa,nm->wam", departures_px, weights[:, found] * scale), independent)


def _of_mean(covariance: Float[np.ndarray, " bursts"]) -> tuple[float, float]:
    """Variance of a mean of bursts, and how many independent ones it is worth.

    `covariance` is of the departures from that mean, at every distance.
    """
    bursts = len(covariance)
    size, independent = float(covariance[0]), float(bursts)
    if size <= 0.0:
        return 0.0, independent
    for _ in range(_ROUNDS):
        total = size / independent / (1.0 - 1.0 / independent)
        apart = covariance[1:] + total
        stop = int(np.argmax(apart <= 0)) if np.any(apart <= 0) else len(apart)
        share = 1.0 - np.arange(1, stop + 1) / bursts
        times = 1.0 + 2.0 * float((share * np.minimum(apart[:stop] / (size + total), 1.0)).sum())
        independent = max(bursts / times, _LEAST_INDEPENDENT)
    return size / independent / (1.0 - 1.0 / independent), independent
