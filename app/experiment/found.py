"""What was found before the wall though nobody stated it, as a result's manifest keeps it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from app.errors import BadInputError
from core.geometry import Vector2, WallName
from core.objects import RoomObject

# What is known of its depth: its foot is seen; it stands no farther away; nothing.
Depth = Literal["seen", "at most", "unknown"]


@dataclass(frozen=True)
class Found:
    """A part of the wall that something hides, and the box that would hide it.

    `share` is that of the view's wall; `x_m` (y of a view of x_min or x_max) and `z_m` are its bounds as seen on the
    wall. `outline_px` are its left,
    top, right and lower edge in the picture of view number `view`. `box` is a proposal that passes no heat.
    `solved`: the air was solved with it, its heat unknown.
    """

    view: int
    share: float
    x_m: Vector2
    z_m: Vector2
    outline_px: tuple[float, float, float, float]
    depth: Depth
    box: RoomObject
    solved: bool = False
    sentence: str = ""
    wall: WallName = "y_max"

    @property
    def entry(self) -> str:
        """The lines of experiment.toml that state it."""
        lower, upper = (", ".join(map(repr, end)) for end in (self.box.lower_m, self.box.upper_m))
        name = f'name = "{self.box.name}"'
        return f"[[scene.objects]]\n{name}\nlower_m = [{lower}]\nupper_m = [{upper}]\n"


_FOUND = TypeAdapter(tuple[Found, ...])


def found_in(manifest: Mapping[str, Any]) -> tuple[Found, ...]:
    """What a result's manifest tells was found; nothing in an older one. Raises BadInputError."""
    try:
        # By JSON's rules, which have no tuples.
        return _FOUND.validate_json(json.dumps(manifest.get("found", ())))
    except ValidationError as error:
        raise BadInputError(
            f"The result's manifest tells of something before the wall in a way that cannot be read "
            f"({error.errors()[0]['msg']}). Reconstruct again."
        ) from error
