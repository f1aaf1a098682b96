"""A solver's checkpoints in the folder of its attempt: written durably, the last two kept."""

import itertools
import time
from pathlib import Path

from app.files.durable import write_durably

KEPT = 2


class FolderStore:
    """Bytes in, bytes out, as `core.solve.checkpoint.CheckpointStore` asks; files are numbered upwards."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        numbers = [int(path.stem) for path in self._files()]
        self._numbers = itertools.count(max(numbers, default=0) + 1)
        self.saved_s = 0.0

    def save(self, content: bytes) -> None:
        """Keep a checkpoint; the one before the one before goes."""
        path = self._folder / f"{next(self._numbers):08d}.checkpoint"
        write_durably(path, lambda temporary: temporary.write_bytes(content))
        self.saved_s = time.time()
        for old in self._files()[KEPT:]:
            old.unlink()

    def load(self) -> list[bytes]:
        """Return what is there, newest first."""
        return [path.read_bytes() for path in self._files()]

    def _files(self) -> list[Path]:
        return sorted(self._folder.glob("[0-9]*.checkpoint"), reverse=True)
