"""Grid size and transport model, from the expected flow's own curvature and numbers."""

import numpy as np

from core.air import GRAVITY_M_S2
from core.plan.choice import Choice
from core.plan.expected import ExpectedFlow
from core.scene import Inlet, Scene

# A plane jet and a heated cavity are unsteady from about these on (Schlichting; Paolucci 1990).
_LAMINAR_RE, _LAMINAR_RA = 1000.0, 1e8
_CELLS = (32, 48, 64, 96)
_GRID_SHARE = 0.025


def grid(scene: Scene, flow: ExpectedFlow) -> Choice:
    """The coarsest grid whose trilinear cells lose little: h^2 / 8 times the second derivatives across the view.

    The limit is a fortieth of the rms departures of T from its mean at each height.
    """
    departure = flow.excess_k - flow.excess_k.mean(axis=(0, 1))
    limit_k = _GRID_SHARE * float(departure.std())
    lost = [np.diff(departure, 2, axis=a)[1:-1, 1:-1, 1:-1] / 8 for a in (0, 2)]
    vertices = max(flow.grid.shape)
    at_expected = float(np.sqrt(np.mean(sum(np.mean(part**2) for part in lost))))
    given = scene.solve.grid
    bounds: dict[int, float] = {
        n: at_expected * ((vertices - 1) / n) ** 2 for n in (_CELLS if given == "auto" else (given,))
    }
    value = next((n for n, bound in bounds.items() if bound <= limit_k), max(bounds))
    return Choice(
        "grid", value, bounds[value], limit_k, "K", (value / _CELLS[-1]) ** 3,
        "what trilinear cells of this size lose of the expected flow, against a fortieth of its departures",
    )  # fmt: skip


def transport(scene: Scene, flow: ExpectedFlow) -> Choice:
    """Turbulent where the supply's Reynolds number or the room's Rayleigh number says so."""
    given = scene.flow.transport
    air, room = scene.air, scene.room
    reynolds = [
        float(np.linalg.norm(b.velocity_m_s)) * _patch_edge_m(b) / air.kinematic_viscosity_m2_s
        for b in scene.boundary
        if isinstance(b, Inlet)
    ]
    contrast = float(np.abs(flow.excess_k).max())
    diffusivity = air.kinematic_viscosity_m2_s / air.prandtl
    rayleigh = GRAVITY_M_S2 * contrast / air.ambient_temperature_k * room.size_m[2] ** 3
    rayleigh /= air.kinematic_viscosity_m2_s * diffusivity
    turbulent = max(reynolds, default=0.0) > _LAMINAR_RE or rayleigh > _LAMINAR_RA
    value = ("k_epsilon" if turbulent else "molecular") if given == "auto" else given
    fastest = max(reynolds, default=0.0)
    reason = f"Re {fastest:.2g}, Ra {rayleigh:.2g}; turbulent above {_LAMINAR_RE:g} or {_LAMINAR_RA:g}"
    return Choice("transport", value, 0.0, 0.0, "", 1.0 if turbulent else 0.6, reason)


def _patch_edge_m(inlet: Inlet) -> float:
    sides = [u - low for low, u in zip(inlet.patch.lower_m, inlet.patch.upper_m, strict=True)]
    return float(np.sqrt(np.prod(sides)))
