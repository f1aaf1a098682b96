"""What a run's time depends on: which programs it needs, and how much is to be solved."""

from dataclasses import replace

import pytest

from app.experiment.plan import Plan, PresetLine, SeenLine
from app.plan.runs import Run
from app.plan.task import counted_work, pixels_of, programs_of, scene_of, task_of, work_of
from app.reconstruct.presets import PRESETS
from app.volume.file import read_volume
from app.volume.measurement import known_planes
from app.volume.scene import RigOptions, room_scene
from core.plan.cost import windows_seen
from core.problem import Problem
from core.scene import Inlet
from tests.rooms import ROOM


@pytest.fixture(scope="module")
def problem() -> Problem:
    volume = read_volume(ROOM)
    scene = room_scene(volume, RigOptions(camera_px=(160, 120)), "surveyed")
    return Problem(scene, (), known_planes(volume, scene))


def warmer(problem: Problem) -> Problem:
    scene = problem.scene
    boundary = tuple(
        replace(known, temperature_k=known.temperature_k + 1.0) if isinstance(known, Inlet) else known
        for known in scene.boundary
    )
    assert boundary != scene.boundary
    return replace(problem, scene=replace(scene, boundary=boundary))


def larger(problem: Problem) -> Problem:
    return replace(problem, scene=room_scene(read_volume(ROOM), RigOptions(camera_px=(640, 480)), "surveyed"))


def finer(problem: Problem, cells: int) -> Problem:
    scene = problem.scene
    return replace(problem, scene=replace(scene, solve=replace(scene.solve, grid=cells)))


def plan_of(problem: Problem, work: float) -> Plan:
    line = PresetLine(
        preset="standard", fits=True, solver_s=None, work=work, memory_mb=None, temperature_error_k=None,
        velocity_error=None, pressure_error=None, reason="",
    )  # fmt: skip
    return Plan(
        scene=scene_of(problem.scene), expected="", expected_contrast_k=1.0, expected_departure_k=1.0, views=[],
        seen=SeenLine(modes=1, modes_seen=1, images=0.0, boundary=0.0, both=0.0), choices=[], presets=[line],
        machine="", verdicts=[],
    )  # fmt: skip


def test_programs_depend_on_sizes_and_not_on_temperatures(problem):
    for preset in PRESETS:
        own = programs_of(preset, problem.scene)
        assert programs_of(preset, warmer(problem).scene) == own
        assert programs_of(preset, finer(problem, 20).scene) != own
    # A march does not see the camera; what works on windows does.
    assert programs_of("standard", larger(problem).scene) == programs_of("standard", problem.scene)
    assert programs_of("draft", larger(problem).scene) != programs_of("draft", problem.scene)
    assert len({programs_of(preset, problem.scene) for preset in PRESETS}) == len(PRESETS)


def test_a_scene_is_the_same_behind_another_camera_and_another_with_other_air(problem):
    assert scene_of(larger(problem).scene) == scene_of(problem.scene)
    assert scene_of(warmer(problem).scene) != scene_of(problem.scene)
    assert scene_of(finer(problem, 20).scene) != scene_of(problem.scene)
    assert pixels_of(larger(problem).scene) == 16 * pixels_of(problem.scene) == 640 * 480


def test_more_pixels_are_more_windows_and_more_cells_more_work(problem):
    assert windows_seen(larger(problem).scene) > windows_seen(problem.scene) > 0
    for preset, more in (("draft", larger(problem)), ("grid", finer(problem, 40))):
        few, many = work_of(preset, problem, None), work_of(preset, more, None)
        assert few is not None
        assert many is not None
        assert few.loops < many.loops


def test_what_a_march_costs_is_known_from_a_plan_or_a_run_of_the_same_scene(problem):
    run = Run(
        at="", preset="standard", programs="", scene=scene_of(problem.scene), folder="", warm=None, pixels=1.0,
        work=7e6, seconds={},
    )  # fmt: skip
    assert counted_work("standard", problem, None, ()) is None
    assert counted_work("standard", problem, None, (run,)) == 7e6
    assert counted_work("standard", problem, plan_of(problem, 5e6), (run,)) == 5e6
    assert counted_work("standard", larger(problem), plan_of(problem, 5e6), ()) == 5e6
    # A plan of what was stated before says nothing of what is stated now.
    assert counted_work("standard", warmer(problem), plan_of(problem, 5e6), (run,)) is None
    assert counted_work("reference", problem, None, (run,)) is None
    assert task_of("standard", problem, 5e6).work == 5e6
