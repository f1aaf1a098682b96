"""What an operator enters of a known room: each reading as wrong as its stated deviation says."""

from dataclasses import replace

import numpy as np

from core.objects import RoomObject
from core.scene import BoundaryInformation, Heater, Inlet, Outlet, Scene, Wall

# Apart from the seeds of noise.
_SEED = 1000


def misread(scene: Scene, seed: int) -> Scene:
    """The scene with every stated temperature, supply and heat of an object off by a draw of its deviation."""
    draw = np.random.default_rng(_SEED + seed).standard_normal

    def read(item: BoundaryInformation) -> BoundaryInformation:
        if isinstance(item, Inlet):
            speed_m_s = float(np.linalg.norm(item.velocity_m_s))
            factor = 1.0 + item.velocity_std_m_s / speed_m_s * float(draw())
            x, y, z = (factor * v for v in item.velocity_m_s)
            warmer_k = item.temperature_std_k * float(draw())
            return replace(item, temperature_k=item.temperature_k + warmer_k, velocity_m_s=(x, y, z))
        if isinstance(item, Outlet) and item.mean_temperature_k is not None:
            warmer_k = item.temperature_std_k * float(draw())
            return replace(item, mean_temperature_k=item.mean_temperature_k + warmer_k)
        if isinstance(item, Wall | Heater) and item.temperature_k is not None:
            return replace(item, temperature_k=item.temperature_k + item.temperature_std_k * float(draw()))
        return item

    def judged(item: RoomObject) -> RoomObject:
        if item.power_w is not None:
            return replace(item, power_w=item.power_w + item.power_std_w * float(draw()))
        if item.temperature_k is not None:
            return replace(item, temperature_k=item.temperature_k + item.temperature_std_k * float(draw()))
        return item

    boundary = tuple(read(item) for item in scene.boundary)
    return replace(scene, boundary=boundary, objects=tuple(judged(item) for item in scene.objects))
