"""The boundary loss of a scene: planes, openings, heaters and walls as rows.

Each field is divided by the largest value that is known of it (paper, section II-D), with the scales'
floors where that would be zero; one scale for the whole velocity vector.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from core.geometry import WallName, face_of
from core.grid.interpolation import interpolation_matrix
from core.known import measured_outlets
from core.losses.boussinesq import FlowValues
from core.losses.physics import BoundaryLoss, KnownValues, MeanLoss, PointLoss
from core.losses.representation import Span, Spans, points_of, positions
from core.problem import PlaneData, Problem, SensorData
from core.scene import Heater, Inlet, OnPatch, Outlet, Patch, Wall
from core.setting import SettingError
from core.solve.nondimensional import RoomFrame

# Weight of a thermometer's or anemometer's error of one standard deviation; the other losses are means of squares.
_READING = 0.01
# The same for an outlet where no plane or sensor is known: it alone fixes the level of T.
_ONLY_READING = 0.1


def boundary_loss(problem: Problem, frame: RoomFrame, *, weight: float, points_an_axis: int) -> BoundaryLoss:
    """Rows of planes, inlets, outlets, heaters and walls, on `points_an_axis` points along each wall axis.

    The edges of a patch are as sharp as those points. Within a patch the condition of its wall is left out.
    """
    patches = [_plane(plane, frame, points_an_axis) for plane in problem.planes]
    known = {plane.wall for plane in problem.planes}
    items = problem.scene.boundary
    held = [item.patch for item in items if isinstance(item, OnPatch)]
    for item in items:
        match item:
            case Wall() if item.wall not in known:
                own = [h for h in held if h.wall == item.wall]
                patches += _wall(item, own, frame, points_an_axis, resolved=_resolves_layers(problem))
            case Inlet() | Outlet() | Heater() if item.patch.wall not in known:
                patches.append(_patch(item, frame, points_an_axis))
            case _:
                pass  # plane fields and sensors come as data in the problem
    return BoundaryLoss(tuple(patches), weight)


def point_losses(problem: Problem, frame: RoomFrame) -> tuple[PointLoss, ...]:
    """Sensors, and one weak row for the constant of p if nothing else fixes it."""
    losses = [_sensors(sensor, frame) for sensor in problem.sensors]
    knows_p = bool(problem.planes) or any(isinstance(item, Outlet) for item in problem.scene.boundary)
    if not knows_p:
        centre = jnp.asarray(
            [[(a + b) / 2 for a, b in zip(frame.lower, frame.upper, strict=True)]], jnp.float32
        )
        weight = FlowValues(jnp.zeros(1), jnp.full(1, 0.01), jnp.zeros((1, 3)))
        losses.append(PointLoss(centre, _zeros((1,)), weight, name="gauge"))
    return tuple(losses)


def level_loss(problem: Problem, frame: RoomFrame, points_an_axis: int) -> MeanLoss | None:
    """The outlets' mean temperatures on walls whose plane is not known; None where there are none."""
    known = {plane.wall for plane in problem.planes}
    outlets = [found for found in measured_outlets(problem.scene) if found[1].patch.wall not in known]
    if not outlets:
        return None
    say = _READING if problem.planes or problem.sensors else _ONLY_READING
    points, target, weight = [], [], []
    for _, outlet, kelvin in outlets:
        spans, axes = _wall_spans(outlet.patch.wall, frame, points_an_axis)
        spans = _inwards(spans, outlet.patch.wall, frame, points_an_axis)
        inside = _inside(outlet.patch, spans, axes, frame).ravel()
        points.append(jnp.asarray(points_of(spans)[inside], jnp.float32))
        target.append((kelvin - frame.scales.reference_k) / frame.scales.excess_k)
        weight.append(say * abs(frame.scales.excess_k) / outlet.temperature_std_k)
    return MeanLoss(tuple(points), jnp.array(target, jnp.float32), jnp.array(weight, jnp.float32))


def _inwards(spans: Spans, wall: WallName, frame: RoomFrame, n: int) -> Spans:
    """Points half a cell inside the wall. Air that leaves has no thermal layer, so these have its temperature."""
    face = face_of(wall)
    axis = face.axis
    step = (frame.upper[axis] - frame.lower[axis]) / (n - 1) * face.inward
    moved = list(spans)
    moved[axis] = (spans[axis][0] + step, spans[axis][0] + step, 1)
    return _triple(moved)


def _plane(plane: PlaneData, frame: RoomFrame, n: int) -> KnownValues:
    spans, axes = _wall_spans(plane.wall, frame, n)
    room, (first, second) = frame.room, axes
    shape = tuple(span[2] for span in spans)

    def resampled(values: Float[np.ndarray, "first second"]) -> np.ndarray:
        targets = [room.lower_m[a] + frame.scales.length_m * positions(spans[a]) for a in (first, second)]
        along = interpolation_matrix(np.asarray(plane.first_m, float), targets[0])
        across = interpolation_matrix(np.asarray(plane.second_m, float), targets[1])
        return (along @ values @ across.T).reshape(shape)

    velocity = np.stack([resampled(plane.velocity_m_s[..., c]) for c in range(3)], axis=-1)
    target = frame.scales.to_nd(
        jnp.asarray(resampled(plane.temperature_k), jnp.float32),
        jnp.asarray(resampled(plane.pressure_m2_s2), jnp.float32),
        jnp.asarray(velocity, jnp.float32),
    )
    # One over the largest value, at least a tenth of the field's scale.
    largest = [
        max(float(jnp.abs(v).max()), 0.1) for v in (target.temperature, target.pressure, target.velocity)
    ]
    return KnownValues(spans, target, _constant(shape, 1 / largest[0], 1 / largest[1], 1 / largest[2]))


def _resolves_layers(problem: Problem) -> bool:
    """Whether the model resolves the thermal layers at walls.

    It does not with the effective transport of a mean flow: there a layer is thinner than a cell, and the wall's
    temperature is not that of the air beside it.
    """
    return problem.scene.flow.transport in ("molecular", "given")


def _wall(wall: Wall, held: list[Patch], frame: RoomFrame, n: int, *, resolved: bool) -> list[KnownValues]:
    spans, axes = _wall_spans(wall.wall, frame, n)
    shape = tuple(span[2] for span in spans)
    free = ~np.any([_inside(h, spans, axes, frame) for h in held], axis=0) if held else np.ones(shape, bool)
    kelvin = wall.temperature_k if wall.temperature_k is not None else frame.scales.reference_k
    target = _values(shape, frame, temperature_k=kelvin)
    weight = _masked(
        free,
        temperature=float(resolved and wall.thermal == "temperature"),
        pressure=0.0,
        velocity=float(wall.no_slip),
    )
    patches = [KnownValues(spans, target, weight)]
    if wall.thermal == "adiabatic":
        patches.append(_insulated(wall.wall, spans, free, frame, n))
    return patches


def _insulated(wall: WallName, spans: Spans, free: np.ndarray, frame: RoomFrame, n: int) -> KnownValues:
    """No heat through the wall: the temperatures half a spacing inside and outside are equal."""
    axis = face_of(wall).axis
    step = (frame.upper[axis] - frame.lower[axis]) / (n - 1)  # half a cell on either side: see `solve_grid`
    place = spans[axis][0]
    before, after = list(spans), list(spans)
    before[axis], after[axis] = (place - step, place - step, 1), (place + step, place + step, 1)
    weight = _masked(free, temperature=1.0, pressure=0.0, velocity=0.0)
    return KnownValues(_triple(after), _zeros(free.shape), weight, minus=_triple(before))


def _patch(item: Inlet | Outlet | Heater, frame: RoomFrame, n: int) -> KnownValues:
    spans, axes = _wall_spans(item.patch.wall, frame, n)
    shape = tuple(span[2] for span in spans)
    inside = _inside(item.patch, spans, axes, frame)
    if not inside.any():
        raise _nothing_inside(item, n)
    match item:
        case Inlet():
            target = _values(shape, frame, item.temperature_k, item.velocity_m_s)
            weight = _masked(inside, temperature=1.0, pressure=0.0, velocity=1.0)
        case Heater():
            target = _values(shape, frame, item.temperature_k)
            weight = _masked(inside, temperature=1.0, pressure=0.0, velocity=1.0)
        case Outlet():
            # Its mean temperature is a row of its own (`level_loss`), not a value at each point.
            target = _values(shape, frame, frame.scales.reference_k)
            weight = _masked(inside, temperature=0.0, pressure=1.0, velocity=0.0)
    return KnownValues(spans, target, weight)


def _nothing_inside(item: Inlet | Outlet | Heater, n: int) -> SettingError:
    patch = item.patch
    return SettingError(
        f"The {item.kind} on {patch.wall} from {patch.lower_m} to {patch.upper_m} m holds none of "
        f"{n} points along each axis of its wall. Check the patch, or take a finer grid."
    )


def _sensors(sensor: SensorData, frame: RoomFrame) -> PointLoss:
    points = (sensor.position_m - np.array(frame.room.lower_m)) / frame.scales.length_m
    t_known, u_known = np.isfinite(sensor.temperature_k), np.isfinite(sensor.velocity_m_s)
    target = frame.scales.to_nd(
        jnp.asarray(np.where(t_known, sensor.temperature_k, frame.scales.reference_k), jnp.float32),
        jnp.zeros(len(points)),
        jnp.asarray(np.where(u_known, sensor.velocity_m_s, 0.0), jnp.float32),
    )
    t_weight = np.where(t_known, _READING * abs(frame.scales.excess_k) / sensor.temperature_std_k, 0.0)
    u_std = np.where(np.isfinite(sensor.velocity_std_m_s), sensor.velocity_std_m_s, 1.0)[:, None]
    u_weight = np.where(u_known, _READING * frame.scales.velocity_m_s / u_std, 0.0)
    weight = FlowValues(
        jnp.asarray(np.nan_to_num(t_weight), jnp.float32),
        jnp.zeros(len(points)),
        jnp.asarray(u_weight, jnp.float32),
    )
    return PointLoss(jnp.asarray(points, jnp.float32), target, weight)


def _wall_spans(wall: str, frame: RoomFrame, n: int) -> tuple[Spans, tuple[int, int]]:
    """The wall's points, and its two axes."""
    face = face_of(wall)
    corner = frame.upper if face.upper else frame.lower
    spans: list[Span] = [(low, high, n) for low, high in zip(frame.lower, frame.upper, strict=True)]
    spans[face.axis] = (corner[face.axis], corner[face.axis], 1)
    return _triple(spans), face.along


def _triple(spans: list[Span]) -> Spans:
    x, y, z = spans
    return x, y, z


def _inside(patch: Patch, spans: Spans, axes: tuple[int, int], frame: RoomFrame) -> np.ndarray:
    inside = np.ones(tuple(span[2] for span in spans), bool)
    for axis, low, high in zip(axes, patch.lower_m, patch.upper_m, strict=True):
        metres = frame.room.lower_m[axis] + frame.scales.length_m * positions(spans[axis])
        along = (metres > low) & (metres < high)
        inside &= along.reshape([-1 if a == axis else 1 for a in range(3)])
    return inside


def _values(
    shape: tuple[int, ...], frame: RoomFrame, temperature_k: float, velocity_m_s: tuple = (0.0, 0.0, 0.0)
) -> FlowValues:
    flow = frame.scales.to_nd(
        jnp.full(shape, temperature_k, jnp.float32),
        jnp.zeros(shape),
        jnp.broadcast_to(jnp.asarray(velocity_m_s, jnp.float32), (*shape, 3)),
    )
    return flow


def _masked(mask: np.ndarray, *, temperature: float, pressure: float, velocity: float) -> FlowValues:
    on = jnp.asarray(mask, jnp.float32)
    return FlowValues(
        temperature * on, pressure * on, jnp.broadcast_to((velocity * on)[..., None], (*mask.shape, 3))
    )


def _constant(shape: tuple[int, ...], temperature: float, pressure: float, velocity: float) -> FlowValues:
    return _masked(np.ones(shape, bool), temperature=temperature, pressure=pressure, velocity=velocity)


def _zeros(shape: tuple[int, ...]) -> FlowValues:
    return FlowValues(jnp.zeros(shape), jnp.zeros(shape), jnp.zeros((*shape, 3)))
