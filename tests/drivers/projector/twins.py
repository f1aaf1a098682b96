"""Every dialect with its twin, its HDMI code, and a second source."""

from drivers.projector.lamp_guard import LampGuard
from drivers.projector.open import DIALECTS as SPOKEN
from drivers.simulated import VirtualClock
from drivers.simulated.projector.engine import SimulatedProjector
from drivers.simulated.projector.open import TWINS, link_to
from drivers.simulated.projector.state import TwinState

DIALECTS = {name: (SPOKEN[name], twin.responder, twin.sources) for name, twin in TWINS.items()}


def make_twin(name, faults=lambda _: None, *, clock=None, seed=0, **options):
    """Return a simulated projector of that dialect."""
    _, responder, sources = DIALECTS[name]
    state = TwinState(clock or VirtualClock(), source=sources[0], sources=sources)
    return SimulatedProjector(responder(state, **options), faults, seed=seed)


def make_link(name, faults=lambda _: None, *, guard=None, seed=0):
    """Return a link on simulated time, and its twin."""
    clock = VirtualClock()
    twin = make_twin(name, faults, clock=clock, seed=seed)
    guard = guard or LampGuard(now_s=clock.now_s)
    return link_to(twin, name, clock, guard), twin, clock
