"""A scene in nondimensional form: scales, Re, Pe, Ri, and the box."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from core.geometry import Box, face_of
from core.known import leaving_excess_k, measured_outlets
from core.losses.boussinesq import FlowValues, Numbers, Scales, scales
from core.losses.representation import Spans, positions
from core.problem import Problem
from core.scene import FlowModel, Heater, Inlet, Outlet, Wall
from core.setting import SettingError

# ν_eff = U L / Re of the mean flow where nothing is given. Two RANS rooms (warm jets, 0.3 and 0.5 m/s,
# volume-mean ν + ν_t) have 1490 and 1790 for momentum and 1260 and 1520 for heat.
_EFFECTIVE_REYNOLDS = 1600.0
_EFFECTIVE_PECLET = 1400.0


class RoomFrame(NamedTuple):
    """Nondimensional coordinates are (x − lower corner) / length."""

    room: Box
    scales: Scales
    numbers: Numbers
    upper: tuple[float, float, float]
    lower: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def vertices(self, shape: tuple[int, int, int]) -> Spans:
        """The vertex grid of the room with this shape."""
        x, y, z = ((low, up, n) for low, up, n in zip(self.lower, self.upper, shape, strict=True))
        return x, y, z


def frame_of(problem: Problem) -> RoomFrame:
    """Scales from the largest known speed and excess temperature; length is the room's height."""
    scene = problem.scene
    ambient = scene.air.ambient_temperature_k
    excess, speeds = [0.0], [0.0]
    for item in scene.boundary:
        match item:
            case Inlet():
                excess.append(item.temperature_k - ambient)
                speeds.append(sum(v * v for v in item.velocity_m_s) ** 0.5)
            case Heater():
                excess.append(item.temperature_k - ambient)
            case Wall(temperature_k=float() as kelvin):
                excess.append(kelvin - ambient)
            case _:
                pass
    for plane in problem.planes:
        departure = plane.temperature_k - ambient
        excess.append(float(departure.flat[abs(departure).argmax()]))
        speeds.append(float((plane.velocity_m_s**2).sum(-1).max() ** 0.5))
    room = scene.room
    found = scales(
        length_m=room.size_m[2], speed_m_s=max(speeds), excess_k=max(excess, key=abs), air=scene.air
    )
    x, y, z = (size / found.length_m for size in room.size_m)
    return RoomFrame(room, found, _numbers(scene.flow, problem, found), (x, y, z))


def height_profile(problem: Problem, frame: RoomFrame, spans: Spans) -> FlowValues:
    """T and p of an upright column of air, carried through the room.

    Of a known plane across x or y: the median over y. Without a plane the temperature of the air that leaves,
    where an outlet knows it, with the pressure of that column: started without it the first step takes the
    buoyancy out of T instead of building p.
    """
    height, scales = positions(spans[2]), frame.scales
    temperature = pressure = np.zeros(len(height))
    upright = [plane for plane in problem.planes if face_of(plane.wall).axis != 2]
    if upright:
        plane = upright[0]
        z_m = frame.room.lower_m[2] + scales.length_m * height
        excess = np.median(plane.temperature_k, axis=0) - scales.reference_k
        temperature = np.interp(z_m, plane.second_m, excess / scales.excess_k)
        kinematic = np.median(plane.pressure_m2_s2, axis=0) / scales.pressure_m2_s2
        pressure = np.interp(z_m, plane.second_m, kinematic)
    elif measured_outlets(problem.scene) and (leaving_k := leaving_excess_k(problem)) is not None:
        level = leaving_k / scales.excess_k
        temperature = np.full(len(height), level)
        pressure = frame.numbers.richardson * level * (height - outlet_height(problem, frame))
    shape = tuple(span[2] for span in spans)
    return FlowValues(
        jnp.broadcast_to(jnp.asarray(temperature, jnp.float32), shape),
        jnp.broadcast_to(jnp.asarray(pressure, jnp.float32), shape),
        jnp.zeros((*shape, 3)),
    )


def outlet_height(problem: Problem, frame: RoomFrame) -> float:
    """Where p is zero: the mean height of the outlets' middles, nondimensional; the floor without any."""
    outlets = [item for item in problem.scene.boundary if isinstance(item, Outlet)]
    return float(np.mean([_height(outlet, frame) for outlet in outlets])) if outlets else frame.lower[2]


def _height(outlet: Outlet, frame: RoomFrame) -> float:
    """Of the patch's middle, where p is zero: nondimensional."""
    room, patch = frame.room, outlet.patch
    face = face_of(patch.wall)
    if face.axis == 2:
        return frame.upper[2] if face.upper else frame.lower[2]
    middle_m = (patch.lower_m[1] + patch.upper_m[1]) / 2
    return (middle_m - room.lower_m[2]) / frame.scales.length_m


def _numbers(flow: FlowModel, problem: Problem, found: Scales) -> Numbers:
    air, convection = problem.scene.air, found.velocity_m_s * found.length_m
    match flow.transport:
        case "molecular":
            viscosity = air.kinematic_viscosity_m2_s
            diffusivity = viscosity / air.prandtl
        case "given":
            if flow.viscosity_m2_s is None or flow.diffusivity_m2_s is None:
                raise SettingError(
                    f"FlowValues transport is 'given', with viscosity_m2_s {flow.viscosity_m2_s} and "
                    f"diffusivity_m2_s {flow.diffusivity_m2_s}; give both, or take transport = 'auto'."
                )
            viscosity, diffusivity = flow.viscosity_m2_s, flow.diffusivity_m2_s
        case _:
            viscosity, diffusivity = convection / _EFFECTIVE_REYNOLDS, convection / _EFFECTIVE_PECLET
    return found.numbers(viscosity_m2_s=viscosity, diffusivity_m2_s=diffusivity, air=air)
