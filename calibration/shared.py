"""Boards that several cameras saw at the same time: what ties the cameras of a rig to one another.

Kept beside the records of the single cameras, whose boards tie each camera to itself only. Positions in pixels,
board points in metres.
"""

import json
from dataclasses import dataclass, replace

from calibration import strict
from calibration.record import SeenBoard


@dataclass(frozen=True)
class SharedBoard:
    """One place of a board, and what each camera that found it saw, by the camera's name."""

    name: str
    seen: dict[str, SeenBoard]


@dataclass(frozen=True)
class SharedRecord:
    """All places that were pictured by several cameras at once."""

    boards: tuple[SharedBoard, ...] = ()

    def with_boards(self, boards: tuple[SharedBoard, ...]) -> "SharedRecord":
        """This record with `boards` added; a place of the same name is replaced."""
        new = {board.name for board in boards}
        return replace(self, boards=tuple(b for b in self.boards if b.name not in new) + boards)

    def without(self, name: str) -> "SharedRecord":
        """This record without the place of that name."""
        return replace(self, boards=tuple(board for board in self.boards if board.name != name))


def shared_to_json(record: SharedRecord) -> str:
    """The record as JSON text."""
    return json.dumps(strict.encode(record), allow_nan=False) + "\n"


def shared_from_json(text: str, source: str) -> SharedRecord:
    """The record in JSON text.

    Raises:
        BundleError: not JSON, an unknown or missing key, a wrong type.
    """
    return strict.from_json(SharedRecord, text, source, "Remove it and take the boards again.")
