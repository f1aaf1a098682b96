"""A plan tells the choices that the preset looks at, at the values that the preset takes."""

from dataclasses import replace

from app.plan.acting import acting_choices, as_solved
from app.plan.make import signals_of
from app.reconstruct.presets import STANDARD
from core.displacement import resolve_window_px
from core.geometry import WALLS
from core.plan.choice import Choice
from core.plan.expected import expected_flow
from core.problem import Problem
from core.room.forward import closure_name
from core.scene import Inlet, Patch, Scene, SolveModel, Wall
from core.solve.draft.draft import draft_grid
from tests.core.plan.scenes import bench, named

SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(0.5, 0.5), upper_m=(0.7, 0.7)),
    temperature_k=293.16,
    velocity_m_s=(1.0, 0.0, 0.0),
)


def choices(scene: Scene, excess_k: float = 0.5) -> dict[str, Choice]:
    still = Problem(replace(scene, boundary=()), ())
    flow = expected_flow(still, excess_k)
    return {choice.name: choice for choice in acting_choices(scene, flow, signals_of(still, flow))}


def test_a_draft_is_told_its_own_grid_and_window_and_no_closure():
    scene = bench(edge_m=1.3, stand_off_m=4.0)
    told = choices(scene)
    assert "transport" not in told
    assert told["grid"].value == max(draft_grid(scene).shape) - 1
    assert told["window"].value == resolve_window_px(scene, scene.views[0])
    assert not {"steps", "precision", "aperture cone", "data term", "irradiance"} & told.keys()


def test_a_marched_room_is_told_its_grid_and_the_closure_that_it_is_marched_with():
    known = (SUPPLY, *(Wall(wall=name, thermal="adiabatic") for name in WALLS))
    scene = replace(bench(edge_m=1.3, stand_off_m=4.0), boundary=known)
    told = choices(scene)
    assert told["grid"].value == STANDARD.cells
    # Marched with k-epsilon also where the air is calm.
    assert told["transport"].value == closure_name(scene) == "k_epsilon"
    coarse = replace(scene, solve=SolveModel(grid=20))
    assert choices(coarse)["grid"].value == as_solved(coarse, "standard").solve.grid == 20


def test_straight_rays_are_judged_where_air_is_too_hot_for_them():
    scene = bench(edge_m=1.3, stand_off_m=4.0)
    assert choices(scene)["ray model"].holds
    hot = choices(*named("a candle on a bench"))["ray model"]
    assert hot.value == "straight"
    assert hot.bound > hot.limit
