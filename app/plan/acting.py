"""The choices that act: each at the value that the preset of this scene works with, and judged there.

What the preset does not look at is not told.
"""

from dataclasses import replace

from app.reconstruct.names import AUTO
from app.reconstruct.presets import STANDARD, resolved, sized
from core.plan.choice import Choice
from core.plan.choices import resolve
from core.plan.expected import ExpectedFlow
from core.plan.signal import Signal
from core.scene import Scene
from core.solve.draft.draft import draft_grid

# Every solver takes shifts of windows, and integrates straight rays exactly.
_ALWAYS = ("window", "print's finest period", "ray model", "grid")
_MARCHED = (*_ALWAYS, "transport")


def acting_choices(scene: Scene, flow: ExpectedFlow, signals: tuple[Signal, ...]) -> tuple[Choice, ...]:
    """The choices of the preset that `auto` takes for this scene."""
    name = resolved(AUTO, scene)
    names = _MARCHED if name == "standard" else _ALWAYS
    made = resolve(as_solved(scene, name), flow, signals).choices
    return tuple(choice for choice in made if choice.name in names)


def as_solved(scene: Scene, name: str) -> Scene:
    """The scene with the grid, the rays and the closure that `draft` or `standard` takes where it says `auto`."""
    if name == "standard":
        cells = sized(STANDARD, scene).cells
    else:
        cells = max(draft_grid(scene).shape) - 1
    closure = "k_epsilon" if scene.flow.transport == "auto" else scene.flow.transport
    return replace(
        scene,
        rays=replace(scene.rays, tracer="straight"),
        solve=replace(scene.solve, grid=cells),
        flow=replace(scene.flow, transport=closure),
    )
