"""The level of the temperature where no plane is known: an outlet's thermometer carries it, on any grid."""

import re
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.known_temperature import VertexGrid
from core.losses.boundary_loss import level_loss
from core.losses.representation import Unknowns
from core.problem import Problem, ShiftMeasurement
from core.rays.operator import build
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, SolveModel, View
from core.solve.draft.draft import solve_draft
from core.solve.grid.grid import GridSettings, initial_unknowns
from core.solve.nondimensional import frame_of

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
OUTLET = Outlet(
    patch=Patch(wall="x_min", lower_m=(1.0, 0.0), upper_m=(2.0, 1.0)),
    mean_temperature_k=295.0,
    temperature_std_k=0.5,
)
INLET = Inlet(
    patch=Patch(wall="x_min", lower_m=(1.0, 2.0), upper_m=(2.0, 3.0)),
    temperature_k=296.0,
    velocity_m_s=(0.3, 0.0, 0.0),
)
CAMERA = looking_along_y(position_m=(2.0, -27.0, 1.5), width_px=200, height_px=150, focal_px=1500.0)
SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), boundary=(INLET, OUTLET))


MIDDLE = jnp.array([[2 / 3, 0.5, 0.5]])


@pytest.fixture(scope="module")
def measured() -> ShiftMeasurement:
    """What air 0.2 K/m warmer upwards would show."""
    grid = VertexGrid(ROOM, (33, 9, 25))
    air_k = np.broadcast_to(0.2 * grid.axes_m[2], grid.shape)
    centres = np.stack(np.meshgrid(np.arange(9.5, 200, 9), np.arange(9.5, 150, 9)), -1).reshape(-1, 2)
    index = SCENE.air.excess_refractivity(jnp.asarray(air_k, jnp.float32))
    shift = np.asarray(build(SCENE, 0, centres, grid.shape, 8.0).apply(index), np.float64)
    information = np.broadcast_to(np.eye(2) * 1e8, (len(centres), 2, 2)).copy()
    return ShiftMeasurement(centres, shift, information, 8)


def test_the_level_of_a_draft_does_not_depend_on_the_number_of_cells(measured):
    for cells in (10, 30):
        scene = replace(SCENE, solve=SolveModel(grid=cells))
        found = solve_draft(Problem(scene, (measured,)))
        level_k = float(found.temperature_k.mean())
        # The outlet's middle is 0.5 m up, the room's 1.5 m: 0.2 K warmer. The images know a slope to a tenth.
        assert level_k == pytest.approx(295.2, abs=0.03)
        # The outlet is known to 0.5 K, and so is every temperature.
        assert 0.2 < np.mean(found.temperature_std_k) < 1.0


def test_swapped_pictures_show_air_that_lies_upside_down(measured):
    swapped = replace(measured, displacement_px=-measured.displacement_px)
    said, unsaid = (" ".join(solve_draft(Problem(SCENE, (shift,))).notes) for shift in (swapped, measured))
    fall_k = float(re.findall(r"it falls by ([\d.]+) K", said)[0])
    assert fall_k == pytest.approx(0.6, abs=0.2)  # towards the prior, in which air gets warmer upwards
    assert "may be swapped" in said
    assert "swapped" not in unsaid


def test_noise_alone_is_not_taken_for_air_that_lies_upside_down(measured):
    for seed in range(10):
        noise = 1e-4 * np.random.default_rng(seed).standard_normal(measured.displacement_px.shape)
        shift = replace(measured, displacement_px=noise)
        assert "swapped" not in " ".join(solve_draft(Problem(SCENE, (shift,))).notes)


@pytest.mark.parametrize(("seen", "left_over"), [(False, 1e-4), (True, 0.02)], ids=["outlet", "images"])
def test_the_grid_starts_in_balance_as_warm_as_the_outlet_says(measured, seen, left_over):
    problem = Problem(SCENE, (measured,) if seen else ())
    frame = frame_of(problem)
    unknowns = initial_unknowns(problem, frame, GridSettings(cells=8, coarsest=8))
    fields = unknowns.representation.fields()
    left = fields.residuals(frame.numbers, None)
    # Against the buoyancy that a column of pressure must carry. The draft's air is not quite even across.
    buoyancy = frame.numbers.richardson * float(jnp.abs(fields.at(MIDDLE).temperature)[0])
    for rows in (left.mass, left.momentum):
        assert float(jnp.abs(rows).max()) < left_over * buoyancy


def test_an_outlets_mean_is_one_row_in_units_of_its_deviation():
    problem = Problem(SCENE, ())
    frame = frame_of(problem)
    warmer = Problem(replace(SCENE, boundary=(INLET, replace(OUTLET, mean_temperature_k=295.5))), ())
    unknowns = initial_unknowns(problem, frame, GridSettings(cells=8, coarsest=8))
    fields, others = unknowns.representation.fields(), Unknowns(unknowns.representation)
    loss, off = (level_loss(p, frame, 17) for p in (problem, warmer))
    assert loss is not None
    assert off is not None
    (row,), (moved,) = (each.rows(fields, others, None) for each in (loss, off))
    assert float(row[0]) == pytest.approx(0.0, abs=1e-4)
    # One deviation below; an only thermometer weighs a tenth of that against means of squares.
    assert float(moved[0]) == pytest.approx(-0.1, rel=1e-3)
    assert level_loss(Problem(replace(SCENE, boundary=(INLET,)), ()), frame, 17) is None
