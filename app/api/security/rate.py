"""Token buckets by key, bounded in number, so that nobody can fill the memory with invented keys."""

import time
from collections import OrderedDict
from collections.abc import Callable


class RateLimiter:
    """`rate_per_s` requests a second and key, with bursts of five seconds' worth."""

    def __init__(
        self, rate_per_s: float, clock_s: Callable[[], float] = time.monotonic, keys: int = 1024
    ) -> None:
        self._rate_per_s = rate_per_s
        self._burst = max(1.0, 5.0 * rate_per_s)
        self._clock_s = clock_s
        self._keys = keys
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, key: str) -> float:
        """Take one token and return 0, or return the seconds until there is one."""
        now_s = self._clock_s()
        tokens, seen_s = self._buckets.pop(key, (self._burst, now_s))
        tokens = min(self._burst, tokens + (now_s - seen_s) * self._rate_per_s)
        allowed = tokens >= 1.0
        self._buckets[key] = (tokens - 1.0 if allowed else tokens, now_s)
        while len(self._buckets) > self._keys:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1.0 - tokens) / self._rate_per_s
