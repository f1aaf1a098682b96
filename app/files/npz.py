"""NumPy's files that somebody gives: bounded before anything is unpacked, without objects.

NumPy reads the header of an array by Python's `ast`, and all threads share one count of its depth (CPython issue
106905): of two that read at once one may be told "AST constructor recursion depth mismatch" of a good file. So
threads read one at a time.
"""

import threading
import zipfile
from pathlib import Path

import numpy as np

from app.errors import BadInputError
from app.files.reading import reading

LARGEST_BYTES = 2 << 30
ONE_AT_A_TIME = threading.Lock()


def read_npy(path: Path) -> np.ndarray:
    """The array. Raises ValueError for what is none."""
    with ONE_AT_A_TIME:
        return np.load(path, allow_pickle=False)


def read_npz(path: Path, what_to_do: str, names: tuple[str, ...] | None = None) -> dict[str, np.ndarray]:
    """The arrays of `names`, or all. Raises BadInputError for a file that lacks one, or is too large."""
    with reading(path, what_to_do):
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(info.file_size for info in archive.infolist())
        if unpacked > LARGEST_BYTES:
            raise BadInputError(
                f"{path} unpacks to {unpacked / 1e9:.1f} GB; expected at most {LARGEST_BYTES / 1e9:.1f} GB. "
                "Resample it on a coarser grid."
            )
        with ONE_AT_A_TIME, np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in names or file.files}
