"""The simulated projector of every dialect, with the codes of its sources, the first of them its HDMI."""

from dataclasses import dataclass

from drivers.clock import Clock
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.link import ProjectorLink
from drivers.projector.open import DIALECTS
from drivers.projector.pjlink_port import PjLinkPort
from drivers.simulated.projector.benq import BenQTwin
from drivers.simulated.projector.engine import SimulatedProjector
from drivers.simulated.projector.escvp21 import EscVp21Twin
from drivers.simulated.projector.hosts import LoopPort
from drivers.simulated.projector.nec import NecTwin
from drivers.simulated.projector.optoma import OptomaTwin
from drivers.simulated.projector.pjlink import PjLinkTwin
from drivers.simulated.projector.state import TwinState


@dataclass(frozen=True)
class Twin:
    """The projector's side of a dialect, and its source codes."""

    responder: type
    sources: tuple[str, ...]


TWINS = {
    "escvp21": Twin(EscVp21Twin, ("30", "A0")),
    "pjlink": Twin(PjLinkTwin, ("31", "32")),
    "benq": Twin(BenQTwin, ("hdmi", "hdmi2")),
    "optoma": Twin(OptomaTwin, ("1", "15")),
    "nec": Twin(NecTwin, ("1A", "01")),
}


def link_to(
    projector: SimulatedProjector, dialect: str, clock: Clock, guard: LampGuard | None = None
) -> ProjectorLink:
    """Return a link inside this process to a simulated projector of that dialect."""
    port = LoopPort(projector)
    line = PjLinkPort(port, clock=clock) if dialect == "pjlink" else port
    return ProjectorLink(DIALECTS[dialect](), line, guard=guard, clock=clock)


def open_twin(dialect: str, clock: Clock, warm_up_s: float, cool_down_s: float) -> ProjectorLink:
    """Return a simulated projector of that dialect, whose lamp takes those times."""
    twin = TWINS[dialect]
    state = TwinState(clock, warm_up_s, cool_down_s, source=twin.sources[0], sources=twin.sources)
    return link_to(SimulatedProjector(twin.responder(state)), dialect, clock)
