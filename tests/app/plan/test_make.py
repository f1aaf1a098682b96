"""What the plan says of a preset that would refuse the experiment."""

from dataclasses import replace

from app.plan.make import preset_lines
from core.plan.expected import expected_flow
from core.problem import Problem
from core.scene import Outlet
from tests.core.test_known_temperature import LEAVING_K, OUT, plane, scene


def reason_of_draft(problem: Problem) -> tuple[bool, str]:
    line = next(line for line in preset_lines(problem, expected_flow(problem)) if line.preset == "draft")
    return line.fits, line.reason


def test_no_draft_is_promised_where_planes_show_walls_alone():
    fits, reason = reason_of_draft(Problem(scene(), (), (plane(),)))
    assert not fits
    assert reason.startswith("Nothing fixes the level of the temperature")


def test_a_draft_is_promised_where_an_outlet_tells_the_level():
    outlet = Outlet(patch=replace(OUT, wall="x_max"), mean_temperature_k=LEAVING_K, temperature_std_k=0.1)
    fits, _ = reason_of_draft(Problem(scene(outlet), (), (plane(),)))
    assert fits
