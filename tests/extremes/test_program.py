"""What a scene does not name is not compiled: counted in the programs, not believed."""

from collections import Counter
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.grid.multiresolution import MultiGrid, zero_multigrid
from core.grid.staggered import StaggeredGrid
from core.losses.physics import all_rows
from core.losses.representation import Unknowns
from core.problem import Problem, SensorData, ShiftMeasurement
from core.rays import StraightTracer
from core.rays.operator import build
from core.render import pixel_geometry
from core.render.shift import wall_offset_m
from core.scene import FixedTexture, Light, PointSensors, ProjectedPattern, Scene, View
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, Weights, losses_of
from tests.extremes.test_render import field

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 1.5))
CAMERA = looking_along_y(position_m=(1.0, -2.0, 0.75), width_px=64, height_px=48, focal_px=80.0)
LAMP = replace(CAMERA, position_m=(1.4, -2.0, 0.9))
PIXELS = np.stack(np.meshgrid(np.linspace(20, 44, 3), np.linspace(18, 30, 3)), -1).reshape(-1, 2)


def scene(light: Light) -> Scene:
    """A print or a projector, and one sensor at a wall: no velocity is stated anywhere."""
    known = (PointSensors(file="wall.csv"),)
    return Scene(room=ROOM, views=(View(camera=CAMERA),), light=light, boundary=known)


def operations(jaxpr) -> Counter:
    """Primitives of a program, those of its inner programs included."""
    count: Counter = Counter()
    for equation in jaxpr.eqns:
        count[equation.primitive.name] += 1
        for value in equation.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                if hasattr(inner, "eqns") or hasattr(inner, "jaxpr"):
                    count += operations(getattr(inner, "jaxpr", inner))
    return count


def test_rays_to_a_print_trace_once_and_to_a_projected_pattern_twice():
    def traced(light: Light) -> Counter:
        geometry = pixel_geometry(scene(light), 0, PIXELS)
        return operations(
            jax.make_jaxpr(lambda g: wall_offset_m(g, field(10.0, ROOM), StraightTracer(8)))(geometry)
        )

    printed, projected = traced(FixedTexture()), traced(ProjectedPattern(projector=LAMP))

    # A loop over the steps for each optics that is named.
    assert (printed["scan"], projected["scan"]) == (1, 2)
    assert sum(projected.values()) > 1.9 * sum(printed.values())


def test_the_operator_of_a_print_has_half_the_products_of_a_projectors():
    def products(light: Light) -> int:
        operator = build(scene(light), 0, PIXELS, (5, 6, 4))
        program = jax.jit(lambda o, n: o.apply(n)).lower(operator, jnp.zeros((5, 6, 4))).as_text()
        return program.count("dot_general")

    printed, projected = products(FixedTexture()), products(ProjectedPattern(projector=LAMP))

    assert printed > 1
    # One product more turns metres into pixels in both.
    assert projected - 1 == 2 * (printed - 1)


def problem(light: Light) -> Problem:
    shift = ShiftMeasurement(
        PIXELS, np.full((9, 2), 1e-3), np.broadcast_to(np.eye(2) * 1e6, (9, 2, 2)).copy(), 8
    )
    sensor = SensorData(
        np.array([[1.0, 1.9, 0.7]]),
        np.array([300.0]),
        np.array([0.2]),
        np.full((1, 3), np.nan),
        np.array([np.nan]),
    )
    return Problem(scene(light), (shift,), (), (sensor,))


@pytest.mark.parametrize(
    "light", [FixedTexture(), ProjectedPattern(projector=LAMP)], ids=["print", "projector"]
)
def test_without_a_velocity_no_momentum_is_asked_for(light: Light):
    given = problem(light)
    frame = frame_of(given)
    start = zero_multigrid(StaggeredGrid(frame.lower, frame.upper, (4, 4, 4)))

    def velocity_slope(regime: str) -> tuple[float, Counter]:
        losses = losses_of(given, frame, regime, Weights(), DataModel(), (5, 6, 4), 5)

        def objective(unknowns: MultiGrid):
            rows = jax.tree.leaves(all_rows(losses, Unknowns(unknowns)))
            return sum(jnp.sum(row**2) for row in rows)

        moving = jax.tree.map(lambda a: a + 0.01, start)
        slope = jax.grad(objective)(moving)
        sizes = [float(jnp.abs(c).max()) for level in slope.levels for c in level.velocity]
        return max(sizes), operations(jax.make_jaxpr(objective)(start).jaxpr)

    still, without = velocity_slope("bos+boundary")
    moved, with_momentum = velocity_slope("bos+pde+boundary")

    # No velocity enters the objective of a scene that names none; the equations would bring it in.
    assert still == 0.0
    assert moved > 0.0
    assert sum(without.values()) < sum(with_momentum.values())
