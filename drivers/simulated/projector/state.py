"""What a projector does, whatever it speaks: it warms, shines, cools; and it remembers what it was told."""

from dataclasses import dataclass, field

from drivers.clock import Clock
from drivers.projector.protocol import PowerState


@dataclass
class TwinState:
    """The machine behind the plug. Times in seconds on `clock`."""

    clock: Clock
    warm_up_s: float = 40.0
    cool_down_s: float = 30.0
    source: str = "30"
    sources: tuple[str, ...] = ("30", "A0", "10")
    muted: bool = False
    frozen: bool = False
    lamp_hours: int = 1234
    errors: tuple[str, ...] = ()
    name: str = "TWIN-1"
    ignitions: int = 0
    _lit: bool = False
    _changed_s: float = field(default=float("-inf"))

    @property
    def power(self) -> PowerState:
        """The power state now."""
        since_s = self.clock.now_s() - self._changed_s
        if self._lit:
            return PowerState.WARMING if since_s < self.warm_up_s else PowerState.ON
        return PowerState.COOLING if since_s < self.cool_down_s else PowerState.STANDBY

    @property
    def ready_in_s(self) -> float:
        """Seconds until the present switch is over."""
        length_s = self.warm_up_s if self._lit else self.cool_down_s
        return max(0.0, self._changed_s + length_s - self.clock.now_s())

    def turn_on(self) -> bool:
        """Light the lamp; False while it cools down."""
        if self.power is PowerState.COOLING:
            return False
        if not self._lit:
            self._lit, self._changed_s = True, self.clock.now_s()
            self.ignitions += 1
        return True

    def turn_off(self) -> bool:
        """Put the lamp out; False while it warms up."""
        if self.power is PowerState.WARMING:
            return False
        if self._lit:
            self._lit, self._changed_s = False, self.clock.now_s()
            self.muted = self.frozen = False
        return True

    def select(self, code: str) -> bool:
        """Change the input; False for one that is not there."""
        if code not in self.sources:
            return False
        self.source = code
        return True
