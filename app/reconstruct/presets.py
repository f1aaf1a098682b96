"""Named ways to solve: what each costs and what it bought is in README, measured by `airlens bench`."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

from app.errors import BadInputError
from core.known import level_of
from core.problem import Problem
from core.result import Solution
from core.scene import Scene
from core.solve.draft.draft import solve_draft
from core.solve.recipes import solve_grid_recipe, solve_paper
from core.solve.room import RoomSettings, solve_room

OnEvent = Callable[[dict[str, Any]], object]


class Solve(Protocol):
    """A road from a problem to the air."""

    def __call__(self, problem: Problem, *, on_event: OnEvent | None = None) -> Solution:
        """Solve, reporting every recorded iteration."""
        ...


# What every door takes where nobody chooses.
AUTO = "auto"
STANDARD = RoomSettings()
# Where walls are unknown the search may still gain after the eight rounds of `standard`; it ends where it does not.
REFERENCE = RoomSettings(cells=64, coarse_cells=40, restart_s=80.0, rounds=16, renewals=4)


def solve_standard(problem: Problem, *, on_event: OnEvent | None = None) -> Solution:
    """The room marched at 48^3, its boundary corrected by the images: minutes."""
    return solve_room(problem, sized(STANDARD, problem.scene), on_event=on_event)


def solve_reference(problem: Problem, *, on_event: OnEvent | None = None) -> Solution:
    """The same at 64^3 and longer."""
    return solve_room(problem, sized(REFERENCE, problem.scene), on_event=on_event)


def sized(settings: RoomSettings, scene: Scene) -> RoomSettings:
    """The settings at the scene's own grid, where it states one; two thirds of it for the coarse room."""
    cells = scene.solve.grid
    return settings if cells == "auto" else replace(settings, cells=cells, coarse_cells=2 * cells // 3)


PRESETS: Mapping[str, Solve] = {
    "draft": solve_draft,
    "grid": solve_grid_recipe,
    "paper": solve_paper,
    "standard": solve_standard,
    "reference": solve_reference,
}


def resolved(name: str, scene: Scene) -> str:
    """`standard` where something that drives the air and all walls are stated, else `draft`.

    Any other name stays as it is.
    """
    if name != AUTO:
        return name
    return "standard" if level_of(Problem(scene, ())) == "surveyed" else "draft"


def preset(name: str) -> Solve:
    """The preset called `name`. Raises BadInputError."""
    try:
        return PRESETS[name]
    except KeyError:
        raise BadInputError(f"There is no preset {name!r}; known: {', '.join(PRESETS)}.") from None


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


def solve_with(solve: Solve, problem: Problem, **given: Any) -> Solution:
    """Solve, handing on what this solver takes of `on_event`, `store` and `should_stop`."""
    taken = inspect.signature(solve).parameters
    return solve(problem, **{name: value for name, value in given.items() if name in taken})
