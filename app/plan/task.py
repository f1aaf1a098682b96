"""What a run's time depends on, as far as it is known before: by it runs are compared."""

import hashlib
import importlib.metadata
import json
from collections import Counter

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.plan import Plan, read_plan
from app.files.toml import to_plain
from app.plan.promise import Task
from app.plan.runs import Run, kept_runs
from app.reconstruct.presets import REFERENCE, STANDARD, sized
from app.reconstruct.problem import Known
from core.plan.cost import draft_work, grid_work, paper_work, room_work, windows_seen
from core.plan.expected import ExpectedFlow
from core.plan.speed import Work
from core.problem import Problem
from core.scene import Scene

# Presets that march the room: their programs do not depend on the camera.
_MARCHED = {"standard": STANDARD, "reference": REFERENCE}


def task_in(experiment: Experiment, known: Known, preset: str) -> Task:
    """The task of an experiment's next run, before a picture is read."""
    problem = Problem(known.scene, (), known.planes, known.sensors)
    try:
        plan = read_plan(experiment)
    except BadInputError:
        plan = None  # Whoever reads it is told; the run does not need it.
    return task_of(preset, problem, counted_work(preset, problem, plan, kept_runs()))


def task_of(preset: str, problem: Problem, work: float | None) -> Task:
    """The task of solving `problem` by a preset."""
    scene = problem.scene
    return Task(preset, programs_of(preset, scene), scene_of(scene), pixels_of(scene), work)


def work_of(preset: str, problem: Problem, flow: ExpectedFlow | None) -> Work | None:
    """The work, counted from the scene; where the room is marched also from the expected flow, None without."""
    if preset in _MARCHED:
        return room_work(problem, flow, sized(_MARCHED[preset], problem.scene)) if flow else None
    if preset == "draft":
        return draft_work(problem, windows_seen(problem.scene))
    return grid_work(problem) if preset == "grid" else paper_work()


def counted_work(preset: str, problem: Problem, plan: Plan | None, runs: tuple[Run, ...]) -> float | None:
    """The work without a march: from the scene, else from a plan or an earlier run of the same scene, else None."""
    found = work_of(preset, problem, None)
    if found is not None:
        return found.loops
    scene = scene_of(problem.scene)
    if plan is not None and plan.scene == scene:
        return next((line.work for line in plan.presets if line.preset == preset), None)
    return next((run.work for run in reversed(runs) if (run.preset, run.scene) == (preset, scene)), None)


def pixels_of(scene: Scene) -> float:
    """Pixels of one picture of every view."""
    return float(sum(view.camera.width_px * view.camera.height_px for view in scene.views))


def scene_of(scene: Scene) -> str:
    """A short hash of the room and what is stated of it: what a march depends on, and no calibration changes."""
    plain = to_plain(scene)
    return _hash({name: plain.get(name) for name in ("room", "air", "boundary", "objects", "flow", "solve")})


def programs_of(preset: str, scene: Scene) -> str:
    """A short hash of what shapes a preset's programs: sizes and kinds, but no temperature or place."""
    views = [[view.camera.width_px, view.camera.height_px] for view in scene.views]
    return _hash(
        {
            "preset": preset,
            "versions": [importlib.metadata.version(name) for name in ("airlens", "jax")],
            "views": len(views) if preset in _MARCHED else views,
            "light": scene.light.kind,
            "room": to_plain(scene.room),
            "kinds": sorted(Counter(known.kind for known in scene.boundary).items()),
            "objects": len(scene.objects),
            "flow": to_plain(scene.flow),
            "solve": to_plain(scene.solve),
        }
    )


def _hash(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
