"""Named ways to solve: what each costs and what it bought is in README, measured by `airlens bench`."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from app.errors import BadInputError
from app.reconstruct.names import AUTO, known
from core.checkpoint import ForeignCheckpointError
from core.known import level_of
from core.problem import Problem
from core.result import Solution
from core.scene import Scene
from core.solve.draft.draft import solve_draft
from core.solve.draft.temperature_prior import TemperatureSettings
from core.solve.grid.grid import solve_grid
from core.solve.network.mlp import solve_mlp
from core.solve.recipes import grid_settings, paper_settings
from core.solve.room import RoomSettings, solve_room
from core.watch import Watch


class Solve(Protocol):
    """A solver with its settings."""

    def __call__(self, problem: Problem, watch: Watch = Watch()) -> Solution:
        """Solve; `watch` is told of it, may stop it, and keeps what it can go on from."""
        ...


STANDARD = RoomSettings()
# Where walls are unknown the search may still gain after the eight rounds of `standard`; it ends where it does not.
REFERENCE = RoomSettings(cells=64, coarse_cells=40, restart_s=120.0, rounds=16, renewals=4)


def draft(problem: Problem, watch: Watch = Watch()) -> Solution:
    """Temperature alone, in seconds."""
    return solve_draft(problem, TemperatureSettings(), watch)


def grid(problem: Problem, watch: Watch = Watch()) -> Solution:
    """The paper's method on a grid of cells instead of its network."""
    return solve_grid(problem, grid_settings(problem), watch)


def paper(problem: Problem, watch: Watch = Watch()) -> Solution:
    """The paper's method with its network: hours without a graphics card."""
    return solve_mlp(problem, paper_settings(problem), watch)


def standard(problem: Problem, watch: Watch = Watch()) -> Solution:
    """Temperature, pressure and velocity by a flow solver that the pictures correct: minutes."""
    return solve_room(problem, sized(STANDARD, problem.scene), watch)


def reference(problem: Problem, watch: Watch = Watch()) -> Solution:
    """As standard, on a finer grid: takes longer."""
    return solve_room(problem, sized(REFERENCE, problem.scene), watch)


def sized(settings: RoomSettings, scene: Scene) -> RoomSettings:
    """The settings at the scene's own grid, where it states one; two thirds of it for the coarse room."""
    cells = scene.solve.grid
    return settings if cells == "auto" else replace(settings, cells=cells, coarse_cells=2 * cells // 3)


PRESETS: Mapping[str, Solve] = {
    "draft": draft,
    "grid": grid,
    "paper": paper,
    "standard": standard,
    "reference": reference,
}


def solved(solve: Solve, problem: Problem, watch: Watch) -> Solution:
    """Solve, going on from what is kept; afresh, and told so, where that is of another problem or other settings.

    Nothing is said of the air where objects are.
    """
    return _solved(solve, problem, watch).without_objects(problem.scene.objects)


def _solved(solve: Solve, problem: Problem, watch: Watch) -> Solution:
    try:
        return solve(problem, watch)
    except ForeignCheckpointError:
        watch.tell({"doing": "start afresh: what was kept is of other captures or other settings"})
        if watch.store is not None:
            watch.store.clear()
        return solve(problem, watch)


def resolved(name: str, scene: Scene) -> str:
    """Standard where something that drives the air and all walls are stated, else draft.

    Any other name stays as it is.
    """
    if name != AUTO:
        return name
    return "standard" if level_of(Problem(scene, ())) == "surveyed" else "draft"


def preset(name: str) -> Solve:
    """The preset called `name`. Raises BadInputError."""
    return PRESETS[known(name)]


def check_data_term(name: str, scene: Scene) -> None:
    """Refuse a data term that this preset does not use. Raises BadInputError."""
    asked = scene.solve.data_term
    if asked == "rendered":
        raise BadInputError(
            "solve.data_term is 'rendered', which compares single samples whose places only a simulation knows; "
            "captures have none. Take 'displacement', or 'warped' with the preset grid."
        )
    if asked == "warped" and name != "grid":
        raise BadInputError(
            f"solve.data_term is 'warped', but the preset {name!r} works on displacements of windows. "
            "Take the preset grid, or data_term = 'displacement'."
        )
