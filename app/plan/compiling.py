"""How long this process compiled: JAX tells of every program that it traces, compiles or finds on the disk."""

import threading
import time
from dataclasses import dataclass

_TRACED = ("/jax/core/compile/jaxpr_trace_duration", "/jax/core/compile/jaxpr_to_mlir_module_duration")
_MADE = "/jax/core/compile/backend_compile_duration"
_FOUND = "/jax/compilation_cache/cache_hits"

Span = tuple[float, float]


@dataclass(frozen=True)
class Compiled:
    """Seconds that were spent compiling, programs that were made ready, and how many of them lay on the disk."""

    seconds: float = 0.0
    programs: int = 0
    found: int = 0

    def since(self, before: "Compiled") -> "Compiled":
        """What was compiled after `before`."""
        return Compiled(
            self.seconds - before.seconds, self.programs - before.programs, self.found - before.found
        )

    @property
    def is_warm(self) -> bool | None:
        """Whether most programs were found compiled; None where none was needed."""
        return 2 * self.found > self.programs if self.programs else None


class Compiling:
    """Adds up what JAX tells. A moment counts once, whether programs are nested or threads compile at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._spans: list[Span] = []
        self._programs = self._found = 0

    @property
    def so_far(self) -> Compiled:
        """What was compiled until now."""
        with self._lock:
            self._spans = union(self._spans)
            seconds = sum(end - start for start, end in self._spans)
            return Compiled(seconds, self._programs, self._found)

    def on_duration(self, event: str, duration_secs: float, **_: str | int) -> None:
        """JAX says at its end how long something took."""
        if event in _TRACED or event == _MADE:
            end = time.perf_counter()
            with self._lock:
                self._spans.append((end - duration_secs, end))
                self._programs += event == _MADE

    def on_event(self, event: str, **_: str | int) -> None:
        """JAX says that something happened."""
        if event == _FOUND:
            with self._lock:
                self._found += 1


def union(spans: list[Span]) -> list[Span]:
    """The same moments as spans that do not touch."""
    apart: list[Span] = []
    for start, end in sorted(spans):
        if apart and start <= apart[-1][1]:
            apart[-1] = (apart[-1][0], max(apart[-1][1], end))
        else:
            apart.append((start, end))
    return apart


_heard: list[Compiling] = []
_only_once = threading.Lock()


def compiling() -> Compiling:
    """The one that listens to this process, from the first call on."""
    from jax import monitoring

    with _only_once:
        if not _heard:
            heard = Compiling()
            monitoring.register_event_duration_secs_listener(heard.on_duration)
            monitoring.register_event_listener(heard.on_event)
            _heard.append(heard)
        return _heard[0]
