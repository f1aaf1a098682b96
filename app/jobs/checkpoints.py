"""A folder as a store of named blobs: what a solver keeps in it is there, whole, after a kill or a power cut."""

from collections.abc import Iterator, MutableMapping
from pathlib import Path

from app.files.durable import write_durably

_SUFFIX = ".checkpoint"


class FolderStore(MutableMapping[str, bytes]):
    """A `core.watch.Store`: one file a name, made by one rename. The folder is made with the first of them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __getitem__(self, name: str) -> bytes:
        """Return a blob. Raises KeyError."""
        try:
            return self._path(name).read_bytes()
        except FileNotFoundError:
            raise KeyError(name) from None

    def __setitem__(self, name: str, content: bytes) -> None:
        """Keep a blob durably, in place of the one of that name."""
        write_durably(self._path(name), lambda temporary: temporary.write_bytes(content))

    def __delitem__(self, name: str) -> None:
        """Remove a blob. Raises KeyError."""
        try:
            self._path(name).unlink()
        except FileNotFoundError:
            raise KeyError(name) from None

    def __iter__(self) -> Iterator[str]:
        """Names in their order; a file that is being written has none yet."""
        paths = sorted(self._folder.glob(f"*{_SUFFIX}"))
        return iter([path.stem for path in paths if not path.name.startswith(".")])

    def __len__(self) -> int:
        """How many blobs there are."""
        return sum(1 for _ in self)

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}{_SUFFIX}"
