"""Rays: 0.001 to 2000 K, 0.3 to 1000 m, boxes of 1 cm and 100 m, one voxel, grazing, turned back."""

from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from core.fields import AbstractField, FunctionField, GridField, plume, through_vertices
from core.geometry import Box, looking_along_y
from core.rays import AbstractRayTracer, NonlinearTracer, QuasiLinearTracer, RayOutcome, Rays, StraightTracer
from core.rays.operator import StraightRayOperator, build
from core.rays.yardstick import exact_wall_shift_m
from core.scene import FixedTexture, ProjectedPattern, Scene, View
from tests.core.rays.scenes import AIR, N0, ROOM, rays_from, single, wall_points
from tests.extremes.row import Named, Near, Refused, Row, Within, extremes, prove

STAGE = "rays"
TRACERS = {"straight": StraightTracer, "quasi-linear": QuasiLinearTracer, "nonlinear": NonlinearTracer}
trace = eqx.filter_jit(lambda tracer, rays, field: tracer.bend(rays, field))


def warm(peak_k: float, centre_y_m: float = 0.0) -> FunctionField:
    """A plume between the camera and the wall."""
    return plume(AIR, peak_k=jnp.asarray(peak_k), centre_m=(0.85, centre_y_m, 1.5), radius_m=0.25)


@cache
def before(stand_off_m: float) -> Rays:
    with jax.enable_x64(True):
        points = wall_points(8) * np.array([0.1, 1.0, 0.1]) + np.array([0.77, 0.0, 1.35])
        return rays_from((0.85, 1.5 - stand_off_m, 1.5), points)


def against_yardstick(kelvin: float, stand_off_m: float) -> Row:
    """Float32 against the adaptive solution in float64."""

    centre_y_m = 0.0 if stand_off_m > 1 else 1.2

    def run() -> float:
        with jax.enable_x64(True):
            exact = exact_wall_shift_m(before(stand_off_m), warm(kelvin, centre_y_m), N0, 1e-9)
        field = single(warm(kelvin, centre_y_m))
        found = trace(NonlinearTracer(64, N0), single(before(stand_off_m)), field).wall_shift_m
        return float(np.linalg.norm(np.asarray(found) - exact) / np.linalg.norm(exact))

    # Where the plume reaches the lens and the wall, the midpoint rule shows its second order.
    allowed = 1e-6 if stand_off_m > 1 else 2e-4
    return Row(STAGE, f"{kelvin:g} K seen from {stand_off_m:g} m, float32", run, Within(0.0, allowed))


def ramp(name: str, tracer: AbstractRayTracer, size_m: float, slope_per_m: float) -> Row:
    """A uniform gradient in one voxel: the shift is g L^2 / 2, whatever the box."""

    def run() -> float:
        room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(size_m, size_m, size_m))
        values = np.zeros((2, 2, 2), np.float32)
        values[1] = slope_per_m * size_m
        field = GridField(room.lower_m, room.upper_m, values)
        entry = jnp.asarray([[0.25 * size_m, 0.0, 0.5 * size_m]], jnp.float32)
        rays = Rays(
            entry, jnp.asarray([[0.0, 1.0, 0.0]]), jnp.asarray([size_m], jnp.float32), jnp.zeros(1, jnp.int32)
        )
        return float(tracer.bend(rays, field).wall_shift_m[0, 0] / size_m)

    expected = slope_per_m * size_m / 2
    return Row(STAGE, f"{name}: one voxel of {size_m:g} m", run, Near(expected, rel=5e-6, abs=1e-12))


def still(name: str, tracer: AbstractRayTracer, field: AbstractField) -> Row:
    """Air at rest bends nothing: exactly."""
    run = lambda: trace(tracer, single(before(30.0)), field).wall_shift_m  # noqa: E731
    return Row(STAGE, name, run, Near(0.0))


def outcome(name: str, origin_m, point_m, expected: str) -> Row:
    """Where a straight ray ends."""

    def run() -> str:
        with jax.enable_x64(True):
            return RayOutcome(int(rays_from(origin_m, [point_m]).outcome[0])).name

    return Row(STAGE, name, run, Named(expected))


def bent(name: str, field: FunctionField, direction: tuple[float, float, float], expected: str) -> Row:
    """How a ray ends in air that bends it hard; its shift stays finite."""

    def run() -> str:
        rays = Rays(
            jnp.asarray([[0.0, -1.5, 1.0]]), jnp.asarray([direction]),
            jnp.asarray([3.0 / direction[1]]), jnp.zeros(1, jnp.int32),
        )  # fmt: skip
        found = trace(NonlinearTracer(64), rays, field)
        finite = np.isfinite(np.asarray(found.wall_shift_m)).all()
        return RayOutcome(int(found.outcome[0])).name if finite else "not finite"

    return Row(STAGE, name, run, Named(expected))


def vacuum(name: str, values: np.ndarray, expected) -> Row:
    """Fields that no air has: they must not become NaN, forward or with their gradient."""

    def run() -> np.ndarray:
        field = GridField(ROOM.lower_m, ROOM.upper_m, jnp.asarray(values, jnp.float32))
        shift, slope = loss_and_slope(single(before(3.0)), field)
        return np.concatenate([np.ravel(shift), np.ravel(slope.values)])

    return Row(STAGE, name, run, expected)


@eqx.filter_jit
@eqx.filter_value_and_grad
def _loss(field: GridField, rays: Rays) -> jax.Array:
    return jnp.sum(NonlinearTracer(16, N0).bend(rays, field).wall_shift_m ** 2)


def loss_and_slope(rays: Rays, field: GridField):
    return _loss(field, rays)


def seen(stand_off_m: float, light=None, room: Box = ROOM, **changed) -> Scene:
    x, _, z = room.centre_m
    camera = looking_along_y(
        position_m=(x, room.upper_m[1] - stand_off_m, z), width_px=64, height_px=48,
        focal_px=40.0 * stand_off_m / room.size_m[0],
    )  # fmt: skip
    return Scene(room=room, views=(View(camera=camera),), light=light or FixedTexture(), **changed)


PIXELS = np.stack(np.meshgrid(np.linspace(16, 47, 5), np.linspace(14, 33, 4)), -1).reshape(-1, 2)


def operator(name: str, scene: Scene, shape: tuple[int, int, int], expected, excess: float = -1e-6) -> Row:
    """A slope across the view through the operator, over what straight rays by hand see of it."""

    def run() -> np.ndarray:
        found: StraightRayOperator = build(scene, 0, PIXELS, shape)
        across = np.zeros(shape, np.float32)
        across += excess * np.linspace(0, 1, shape[0], dtype=np.float32)[:, None, None]
        camera, room = scene.views[0].camera, scene.room
        depth_m = min(room.size_m[1], room.upper_m[1] - camera.position_m[1])
        slope_per_m = excess / room.size_m[0]
        # Seen straight on: minus the shift, in pixels of the wall.
        px = -slope_per_m * depth_m**2 / 2 * camera.focal_px[0] / (room.upper_m[1] - camera.position_m[1])
        return np.asarray(found.apply(jnp.asarray(across)))[:, 0] / px

    return Row(STAGE, f"operator: {name}", run, expected)


def lit_from(baseline_m: float) -> ProjectedPattern:
    x, y, z = ROOM.centre_m
    lamp = looking_along_y(
        position_m=(x + baseline_m, y - 30.0, z), width_px=64, height_px=48, focal_px=300.0,
        principal_px=(31.5 + 300.0 * baseline_m / 31.5, 23.5),
    )  # fmt: skip
    return ProjectedPattern(projector=lamp)


def beside(baseline_m: float, expected) -> Row:
    """The same slope, lit by a projector: the camera's shift minus the projector's."""
    scene = seen(31.5, lit_from(baseline_m))
    return operator(f"projector {baseline_m:g} m beside the camera", scene, (5, 6, 4), expected)


def precision(kind: str, field_of, tolerance: float) -> Row:
    """The same rays in float32 and in float64."""

    def run() -> float:
        tracer = NonlinearTracer(32, N0)
        with jax.enable_x64(True):
            wide = np.asarray(trace(tracer, before(30.0), jax.tree.map(jnp.asarray, field_of())).wall_shift_m)
        narrow = np.asarray(trace(tracer, single(before(30.0)), single(field_of())).wall_shift_m)
        return float(np.linalg.norm(narrow - wide) / np.linalg.norm(wide))

    return Row(STAGE, f"{kind}: float32 against float64", run, Within(0.0, tolerance))


VALUES = 1e-5 * np.random.default_rng(0).normal(size=(5, 6, 4))
MIRAGE = FunctionField(lambda x_m: -0.1 * (1.0 + jnp.tanh(4.0 * x_m[1])))
LENS = FunctionField(lambda x_m: 1e-3 * x_m[0] ** 2)
EDGE = looking_along_y(position_m=(-5.0, 1.499, 1.5), width_px=64, height_px=48, focal_px=100.0)

ROWS = [
    *[against_yardstick(k, s) for s in (0.3, 3.0, 30.0, 300.0, 1000.0)
      for k in (1e-3, 0.01, 1.0, 10.0, 100.0, 500.0, 2000.0)],
    *[ramp(n, t(16), s, g) for n, t in TRACERS.items() for s, g in ((0.01, 1e-6), (3.0, 1e-8), (100.0, 1e-7))],
    *[still(f"{n}: still air", t(16), GridField(ROOM.lower_m, ROOM.upper_m, np.zeros((5, 6, 4), np.float32)))
      for n, t in TRACERS.items()],
    *[still(f"{n}: T in = T0", t(16), single(warm(0.0))) for n, t in TRACERS.items()],
    outcome("a ray straight on", (0.85, -5.0, 1.5), (0.85, 1.5, 1.5), "wall"),
    outcome("a ray from within", (0.85, 0.0, 1.5), (2.9, 1.5, 3.0), "wall"),
    outcome("a ray along an edge", (2.9, -5.0, 3.0), (2.9, 1.5, 3.0), "wall"),
    outcome("a ray along a face", (2.9, -5.0, 1.0), (2.9, 1.5, 1.0), "wall"),
    outcome("a ray through a side", (0.85, -5.0, 1.5), (60.0, 1.5, 1.5), "missed"),
    outcome("a ray out of a side", (0.85, 0.0, 1.5), (60.0, 1.5, 1.5), "side"),
    outcome("a ray away from the wall", (0.85, -5.0, 1.5), (0.85, -50.0, 1.5), "missed"),
    outcome("a ray across the view", (0.85, 0.0, 1.5), (9.0, 0.0, 1.5), "side"),
    outcome("a ray from 1000 m", (0.85, -998.5, 1.5), (0.85, 1.5, 1.5), "wall"),
    bent("a mirage", MIRAGE, (0.96, 0.28, 0.0), "turned_back"),
    bent("a mirage met straight on", MIRAGE, (0.0, 1.0, 0.0), "wall"),
    bent("a lens", LENS, (0.0, 1.0, 0.0), "wall"),
    vacuum("a room of vacuum", np.full((5, 6, 4), -N0), Near(0.0, abs=1e-9)),
    vacuum("noise of a thousand times the air", 1e3 * N0 * np.random.default_rng(1).normal(size=(5, 6, 4)),
           Within(-1e6, 1e6)),
    vacuum("values of 1e15", np.where(np.eye(5, 6)[..., None] * np.ones(4) > 0, 1e15, 0.0), Within(-1e6, 1e6)),
    Row(STAGE, "a field of one layer", lambda: GridField((0.0,) * 3, (1.0,) * 3, np.zeros((1, 2, 2))).spacing_m,
        Refused("at least 2")),
    # Oblique rays see the slope 1 + p^2 times and more; the camera stands more than a room away.
    operator("one voxel", seen(30.0), (2, 2, 2), Near(1.0, rel=0.02)),
    operator("one voxel of 1 cm", seen(0.1, FixedTexture(pixel_m=1e-5),
             Box(lower_m=(0.0, 0.0, 0.0), upper_m=(0.01, 0.01, 0.01))), (2, 2, 2), Near(1.0, rel=0.02)),
    operator("one voxel of 100 m", seen(1000.0, FixedTexture(pixel_m=0.1),
             Box(lower_m=(0.0, 0.0, 0.0), upper_m=(100.0, 100.0, 100.0))), (2, 2, 2), Near(1.0, rel=0.02)),
    operator("2000 K", seen(30.0), (2, 2, 2), Near(1.0, rel=0.02), excess=-2.4e-4),
    operator("0.001 K", seen(30.0), (2, 2, 2), Near(1.0, rel=0.02), excess=-9.3e-10),
    operator("from 0.3 m, at up to 80 degrees", seen(0.3), (5, 6, 4), Within(0.5, 1e4)),
    operator("a wall edge-on", Scene(room=ROOM, views=(View(camera=EDGE),), light=FixedTexture()), (5, 6, 4),
             Within(-1e6, 1e6)),
    operator("one layer of vertices", seen(30.0), (1, 2, 2), Refused("at least 2")),
    beside(0.0, Near(0.0, abs=1e-6)),
    # A uniform slope moves camera ray and projector ray alike but for their slant, (10 m / 31.5 m)^2 and more.
    beside(10.0, Within(-1.0, 1.0)),
    precision("a trilinear grid", lambda: GridField(ROOM.lower_m, ROOM.upper_m, VALUES), 2e-5),
    precision("a spline", lambda: through_vertices(ROOM.lower_m, ROOM.upper_m, VALUES), 2e-5),
    precision("a formula", lambda: warm(10.0), 3e-6),
]  # fmt: skip


@extremes(ROWS)
def test_rays_at_their_limits(row: Row, record_property):
    prove(row, record_property)
