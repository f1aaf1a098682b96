"""One resolved `auto`, and the share of the noise that a choice may cost."""

from dataclasses import dataclass
from typing import Any

# A choice may cost the shift a tenth of one window's noise.
SHARE = 0.1
# A bound from a leading term is doubled for the terms left out.
SAFETY = 2.0


@dataclass(frozen=True)
class Choice:
    """One resolved `auto`: its bound and the limit it was held against, and cost as a share of the dearest."""

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
