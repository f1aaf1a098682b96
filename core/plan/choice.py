"""One resolved `auto`: its error bound against a share of the noise."""

from dataclasses import dataclass
from typing import Any

# A choice may change the shift by a tenth of one window's noise.
SHARE = 0.1
# A bound from a leading term is doubled for the terms left out.
SAFETY = 2.0


@dataclass(frozen=True)
class Choice:
    """One resolved `auto`: its error bound, the limit of that, and its cost as a share of the dearest choice's."""

    name: str
    value: Any
    bound: float
    limit: float
    unit: str
    cost_share: float
    reason: str

    @property
    def holds(self) -> bool:
        """Whether the bound is below its limit."""
        return self.bound <= self.limit
