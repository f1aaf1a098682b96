"""A screen without a screen: it shows what it is told, or, scripted, something else."""

import numpy as np

from drivers.display import Picture, picture_digest
from drivers.errors import DeviceSettingError


class SimulatedDisplay:
    """The twin of a pattern display. `picture` is what a camera may look at; `swap` it to cheat."""

    def __init__(self, rows: int, cols: int) -> None:
        self.picture: Picture = np.zeros((rows, cols), np.uint8)
        self._digest = ""

    def show(self, picture: Picture) -> str:
        """Return the digest; refuses another size."""
        if picture.shape != self.picture.shape:
            rows, cols = self.picture.shape
            raise DeviceSettingError(
                f"The picture is {picture.shape[1]} x {picture.shape[0]} and the screen {cols} x {rows}. "
                "Make the pattern of the native size."
            )
        self.picture, self._digest = picture.copy(), picture_digest(picture)
        return self._digest

    def swap(self, picture: Picture) -> None:
        """Show something else without telling, as another program's window does."""
        self.picture = picture.copy()

    def is_showing(self, digest: str) -> bool:
        """Return whether that picture is on screen; a swap goes unnoticed, as on a real one."""
        return digest == self._digest

    def close(self) -> None:
        """Nothing to free."""
