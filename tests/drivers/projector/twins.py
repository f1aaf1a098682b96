"""Every dialect with its twin, its HDMI code, and a second source."""

from drivers.projector.benq import BenQ
from drivers.projector.escvp21 import EscVp21
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.link import ProjectorLink
from drivers.projector.nec import Nec
from drivers.projector.optoma import Optoma
from drivers.projector.pjlink import PjLink
from drivers.projector.pjlink_port import PjLinkPort
from drivers.simulated import VirtualClock
from drivers.simulated.projector.benq import BenQTwin
from drivers.simulated.projector.engine import SimulatedProjector
from drivers.simulated.projector.escvp21 import EscVp21Twin
from drivers.simulated.projector.hosts import LoopPort
from drivers.simulated.projector.nec import NecTwin
from drivers.simulated.projector.optoma import OptomaTwin
from drivers.simulated.projector.pjlink import PjLinkTwin
from drivers.simulated.projector.state import ProjectorState

DIALECTS = {
    "escvp21": (EscVp21, EscVp21Twin, ("30", "A0")),
    "pjlink": (PjLink, PjLinkTwin, ("31", "32")),
    "benq": (BenQ, BenQTwin, ("hdmi", "hdmi2")),
    "optoma": (Optoma, OptomaTwin, ("1", "15")),
    "nec": (Nec, NecTwin, ("1A", "01")),
}


def make_twin(name, faults=lambda _: None, *, clock=None, seed=0, **options):
    """Return a simulated projector of that dialect."""
    _, responder, sources = DIALECTS[name]
    state = ProjectorState(clock or VirtualClock(), source=sources[0], sources=sources)
    return SimulatedProjector(responder(state, **options), faults, seed=seed)


def make_link(name, faults=lambda _: None, *, guard=None, seed=0):
    """Return a link on simulated time, and its twin."""
    clock = VirtualClock()
    twin = make_twin(name, faults, clock=clock, seed=seed)
    port = LoopPort(twin)
    if name == "pjlink":
        port = PjLinkPort(port, clock=clock)
    guard = guard or LampGuard(now_s=clock.now_s)
    return ProjectorLink(DIALECTS[name][0](), port, guard=guard, clock=clock), twin, clock
