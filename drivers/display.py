"""How a pattern gets onto the projector: pixel for pixel, and acknowledged, whatever shows it."""

import hashlib
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

Picture = UInt8[np.ndarray, "picture_rows picture_cols"]


@runtime_checkable
class PatternDisplay(Protocol):
    """Something that shows grey pictures at the projector's native size."""

    def show(self, picture: Picture) -> str:
        """Return the picture's digest once it is on screen.

        Raises DeviceSettingError when the screen has another size, DeviceTimeoutError when nobody answers.
        """
        ...

    def is_showing(self, digest: str) -> bool:
        """Return whether that picture is still on screen: ask before and after each burst."""
        ...

    def close(self) -> None:
        """Free the screen."""
        ...


def picture_digest(picture: Picture) -> str:
    """Return the SHA-256 of the grey values, row by row."""
    return hashlib.sha256(np.ascontiguousarray(picture).tobytes()).hexdigest()
