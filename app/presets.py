"""Named ways to solve: what each costs and what it bought is in README, measured by `airlens bench`."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from app.errors import BadInputError
from core.problem import Problem
from core.result import Solution
from core.solve.draft import solve_draft
from core.solve.recipes import solve_grid_recipe, solve_paper

OnEvent = Callable[[dict[str, Any]], object]


class Solve(Protocol):
    """A road from a problem to the air."""

    def __call__(self, problem: Problem, *, on_event: OnEvent | None = None) -> Solution:
        """Solve, reporting every recorded iteration."""
        ...


PRESETS: Mapping[str, Solve] = {
    "draft": solve_draft,
    "grid": solve_grid_recipe,
    "paper": solve_paper,
}


def preset(name: str) -> Solve:
    """The preset called `name`. Raises BadInputError."""
    try:
        return PRESETS[name]
    except KeyError:
        raise BadInputError(f"There is no preset {name!r}; known: {', '.join(PRESETS)}.") from None
