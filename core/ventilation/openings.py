"""What enters and leaves by each opening of a found flow: air in m3/s, its temperature, and heat in watts.

    heat = rho cp Q (T_supply - T_exhaust)

Density is that of the air at rest, as the Boussinesq equations have it, also where the supply is ten kelvin warmer.
Outlets of unstated flow share what leaves by area. Nobody said so: `outlet_weights` draws other shares.
"""

from collections.abc import Iterator, Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.air import Air
from core.geometry import WALLS, Face, face_of
from core.scene import Inlet, Outlet, Patch, Scene
from core.ventilation.face_flow import FaceFlow, Vertices, around, corner_mean

Weights = Float[np.ndarray, " outlets"]

# A face of an opening's edge lets less than this share of the greatest flow through.
_UNSMEARED = 0.8


class Passage(eqx.Module):
    """One opening of the found flow: m3/s into the room (negative: out of it), and that air's temperature."""

    name: str = eqx.field(static=True)
    inward_m3_s: float
    temperature_k: float


class AirExchange(eqx.Module):
    """All that passes the walls. `heat_w` is what the air brings beyond the exhaust's temperature."""

    passages: tuple[Passage, ...]
    flow_m3_s: float
    supply_k: float
    exhaust_k: float
    heat_w: float


def opening_patches(scene: Scene) -> tuple[Patch, ...]:
    """Patches of the scene's inlets and outlets."""
    return tuple(part.patch for part in scene.boundary if isinstance(part, Inlet | Outlet))


def exchange(
    flow: FaceFlow, temperature_k: Vertices, scene: Scene, weights: Weights | None = None
) -> AirExchange:
    """What the walls let through. `temperature_k` is on the vertices that `flow` lies between.

    Where the scene states no opening, a wall with flow is one for the air that enters, and one for what leaves.
    What passes the stated outlets is multiplied by `weights`, one each, where given.
    """
    passages = tuple(
        _stated(flow, temperature_k, scene, weights) if opening_patches(scene) else _seen(flow, temperature_k)
    )
    supply_k, exhaust_k = (_mean_k(passages, sign) for sign in (1.0, -1.0))
    heat_w = heat_capacity_j_m3_k(scene.air) * flow.entering_m3_s * (supply_k - exhaust_k)
    return AirExchange(passages, flow.entering_m3_s, supply_k, exhaust_k, heat_w)


def outlet_weights(scene: Scene, rng: np.random.Generator) -> Weights:
    """What leaves by each stated outlet over what is taken for it: 1 where its flow is stated, else drawn.

    The drawn shares sum to one and are by area in the mean; where areas are equal, each sharing is as likely as any
    other (a Dirichlet distribution whose numbers sum to the number of outlets).
    """
    outlets = [part for part in scene.boundary if isinstance(part, Outlet)]
    weights, unstated = np.ones(len(outlets)), [n for n, one in enumerate(outlets) if one.flow_m3_s is None]
    if len(unstated) > 1:
        areas_m2 = np.array([outlets[n].patch.area_m2 for n in unstated])
        shares = areas_m2 / areas_m2.sum()
        weights[unstated] = rng.dirichlet(len(unstated) * shares) / shares
    return weights


def heat_capacity_j_m3_k(air: Air) -> float:
    """Of a cubic metre of the air at rest."""
    return air.heat_capacity_j_m3_k


def _stated(
    flow: FaceFlow, temperature_k: Vertices, scene: Scene, weights: Weights | None
) -> Iterator[Passage]:
    of_outlets = iter(() if weights is None else weights)
    for part in scene.boundary:
        if isinstance(part, Inlet | Outlet):
            face = face_of(part.patch.wall)
            inside = around(part.patch, *(flow.axes_m[a] for a in face.along))
            kelvin = [of[inside] for of in _at_faces(temperature_k, face)]
            weight = next(of_outlets, 1.0) if isinstance(part, Outlet) else 1.0
            yield _passage(f"{part.kind} on {part.patch.wall}", weight * flow.inward(face)[inside], *kelvin)


def _seen(flow: FaceFlow, temperature_k: Vertices) -> Iterator[Passage]:
    for wall in WALLS:
        face = face_of(wall)
        inward, kelvin = flow.inward(face), _at_faces(temperature_k, face)
        for kind, through in (("inlet", inward > 0), ("outlet", inward < 0)):
            if through.any():
                yield _passage(f"{kind} on {wall}", inward[through], *(of[through] for of in kelvin))


def _passage(name: str, inward_m3_s: np.ndarray, at_wall_k: np.ndarray, inside_k: np.ndarray) -> Passage:
    """Supply air has one temperature, read where it is not smeared with the wall's; leaving air is as inside."""
    total = float(inward_m3_s.sum())
    weights, kelvin = np.abs(inward_m3_s), inside_k
    if total > 0:
        weights, kelvin = np.where(weights >= _UNSMEARED * weights.max(), weights, 0.0), at_wall_k
    return Passage(name, total, float(np.average(kelvin, weights=weights)) if weights.any() else float("nan"))


def _mean_k(passages: Sequence[Passage], sign: float) -> float:
    """Mean temperature of all that enters (1) or leaves (-1)."""
    those = [p for p in passages if sign * p.inward_m3_s > 0]
    if not those:
        return float("nan")
    return float(np.average([p.temperature_k for p in those], weights=[abs(p.inward_m3_s) for p in those]))


def _at_faces(temperature_k: Vertices, face: Face) -> tuple[np.ndarray, np.ndarray]:
    """T at a wall's faces: on the wall, and one vertex before it, in the room.

    Around an opening the wall's vertices have its surface's temperature. Air that leaves does not have it.
    """
    planes = (
        np.take(np.asarray(temperature_k, np.float64), n, axis=face.axis) for n in (face.end, face.before)
    )
    on_wall, before = (corner_mean(plane, (0, 1)) for plane in planes)
    return on_wall, before
