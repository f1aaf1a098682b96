"""How well a flow changes the room's air: its age, and where a source's air stays.

    nominal time constant = V / Q          air change efficiency = V / Q / (2 <age>)

The efficiency is 1 for a plug that pushes the old air out, 1/2 for a room that is mixed at once, and less where
supply air finds the outlet by itself (Sandberg 1981). The mean age of the air that leaves is V / Q in every flow.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.geometry import WALLS, Vector3, face_of
from core.setting import SettingError
from core.ventilation.face_flow import Cells, FaceFlow
from core.ventilation.tracer import Tracer


class AirChange(eqx.Module):
    """Age of the air in every cell, and what follows from it."""

    flow: FaceFlow
    age_s: Cells

    @property
    def nominal_s(self) -> float:
        """Volume over flow."""
        return float(self.flow.volumes_m3.sum()) / self.flow.entering_m3_s

    @property
    def mean_age_s(self) -> float:
        """Mean over the room."""
        return float(np.average(self.age_s, weights=self.flow.volumes_m3))

    @property
    def leaving_age_s(self) -> float:
        """Mean age of the air that leaves."""
        return leaving_mean(self.flow, self.age_s)

    @property
    def efficiency(self) -> float:
        """Air change efficiency, 0 to 1."""
        return self.nominal_s / (2.0 * self.mean_age_s)

    def index(self, where: Float[np.ndarray, "nx ny nz"] | None = None) -> float:
        """Local air change index of a part of the room: V / Q over the mean age there; 1 where it is mixed."""
        weights = self.flow.volumes_m3 if where is None else self.flow.volumes_m3 * where
        return self.nominal_s / float(np.average(self.age_s, weights=weights))


def air_change(tracer: Tracer) -> AirChange:
    """The mean age of the air: a source of one second a second everywhere. Raises SettingError."""
    return AirChange(tracer.flow, tracer.concentration(tracer.flow.volumes_m3))


def source_effectiveness(tracer: Tracer, position_m: Vector3) -> float:
    """What leaves over the room's mean, for a source at a point: above 1 it is carried off before it spreads.

    Also called contaminant removal effectiveness. Raises SettingError for a point outside the room.
    """
    source = np.zeros(tracer.flow.cells)
    source[_cell(tracer.flow, position_m)] = 1.0
    found = tracer.concentration(source)
    return leaving_mean(tracer.flow, found) / float(np.average(found, weights=tracer.flow.volumes_m3))


def leaving_mean(flow: FaceFlow, values: Cells) -> float:
    """Mean of a scalar in the air that leaves, weighted with the flow."""
    total = 0.0
    for wall in WALLS:
        face = face_of(wall)
        beside = np.take(values, face.end, axis=face.axis)
        total += float(np.sum(np.maximum(-flow.inward(face), 0.0) * beside))
    return total / flow.entering_m3_s


def zone_share(flow: FaceFlow, low_m: Vector3, high_m: Vector3) -> Float[np.ndarray, "nx ny nz"]:
    """How much of each cell lies in a box, 0 to 1."""
    shares = []
    for axis, low, high in zip(flow.axes_m, low_m, high_m, strict=True):
        shared = np.minimum(axis[1:], high) - np.maximum(axis[:-1], low)
        shares.append(np.clip(shared / np.diff(axis), 0.0, 1.0))
    return shares[0][:, None, None] * shares[1][:, None] * shares[2]


def _cell(flow: FaceFlow, position_m: Vector3) -> tuple[int, int, int]:
    places = []
    for name, axis, at in zip("xyz", flow.axes_m, position_m, strict=True):
        if not axis[0] <= at <= axis[-1]:
            raise SettingError(
                f"The source is at {name} = {at:g} m; the room spans {axis[0]:g} to {axis[-1]:g} m. "
                "Give a point in the room, in metres."
            )
        places.append(min(int(np.searchsorted(axis, at, side="right")) - 1, len(axis) - 2))
    return places[0], places[1], places[2]
