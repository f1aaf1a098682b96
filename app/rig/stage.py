"""What stands before the camera while it is calibrated: somebody holds a board, a screen shows patterns.

On a real rig the operator does what a task says; a simulated rig (`app.rig.practice_room`) does it itself.
"""

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from app.errors import AirlensError
from calibration.board import Board
from calibration.guide import WantedView
from core.geometry import Vector3
from drivers.display import PatternDisplay
from drivers.protocols import Camera

# A board by the room's light, before one camera or (shared) before several, or (place) in the dark under the
# projector's.
TaskKind = Literal["board", "shared", "place", "wall", "level", "dark", "light"]


@dataclass(frozen=True)
class HeldBoard:
    """Where a board is held in the room: its centre, and its axes (x along its rows, y down, away from who looks)."""

    centre_m: Vector3
    rotation_rad: Vector3


@dataclass(frozen=True)
class StageTask:
    """One thing to arrange before the next pictures, in the operator's words; `view` only for a board.

    `held` is where a simulated rig holds a board that several cameras see.
    """

    kind: TaskKind
    text: str
    view: WantedView | None = None
    held: HeldBoard | None = None


@runtime_checkable
class Stage(Protocol):
    """A rig that is being calibrated."""

    @property
    def camera(self) -> Camera:
        """The open camera."""
        ...

    @property
    def display(self) -> PatternDisplay | None:
        """What shows patterns through the projector; None where the rig has no projector."""
        ...

    @property
    def panel_px(self) -> tuple[int, int] | None:
        """Native width and height of the projector."""
        ...

    @property
    def arranges_itself(self) -> bool:
        """Whether `arrange` moves things: a simulated rig. A real one waits for its operator."""
        ...

    def arrange(self, task: StageTask) -> None:
        """Bring about what the task says, where that is possible."""
        ...


@dataclass(frozen=True)
class RealStage:
    """A real camera, a real screen, and an operator."""

    camera: Camera
    display: PatternDisplay | None = None
    panel_px: tuple[int, int] | None = None
    arranges_itself: bool = False

    def arrange(self, task: StageTask) -> None:
        """Nothing: the operator does it."""


@dataclass(frozen=True)
class UnopenedStage:
    """A rig that nobody has opened: enough to ask what is wanted next."""

    display: PatternDisplay | None = None
    panel_px: tuple[int, int] | None = None
    arranges_itself: bool = False

    @property
    def camera(self) -> Camera:
        """There is none. Raises AirlensError."""
        raise AirlensError("The camera of this rig is not open. Connect it first.")

    def arrange(self, task: StageTask) -> None:
        """Nothing: nobody is there."""


def board_size_m(board: Board) -> Float[np.ndarray, "2"]:
    """Width and height that the board's points span."""
    points_m = board.points_m[:, :2]
    return points_m.max(axis=0) - points_m.min(axis=0)
