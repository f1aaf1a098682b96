"""Folders of pictures from anywhere: which files, in which order, what is missing.

A frame's number is the last number in its file name; frames that share the folder and the rest of the
name are one sequence (`capture_0/graycode_00.png`, or `pose3_frame007.tif` all in one folder).
"""

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tifffile

from app.errors import BadInputError
from app.files.reading import reading

SUFFIXES = {".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm"}


@dataclass(frozen=True)
class Sequence:
    """Frames that belong together, in the order of their numbers; `missing` are numbers skipped."""

    name: str
    files: tuple[Path, ...]
    missing: tuple[int, ...]


def find_images(folder: Path, pattern: str | None = None) -> list[Path]:
    """Pictures in `folder` (two levels deep, or by the glob `pattern`), in natural order.

    Raises BadInputError when there is no folder or no picture.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder} is no folder; give the folder that holds the calibration pictures.")
    globs = [pattern] if pattern else ["*", "*/*"]
    found = {p for g in globs for p in folder.glob(g) if p.suffix.lower() in SUFFIXES and p.is_file()}
    if not found:
        looked = f"matching {pattern!r}" if pattern else f"({', '.join(sorted(SUFFIXES))})"
        raise BadInputError(f"{folder} holds no picture {looked}; give another folder or --pattern.")
    return sorted(found, key=lambda p: [_natural(part) for part in p.relative_to(folder).parts])


def sequences(folder: Path, files: list[Path]) -> list[Sequence]:
    """The files grouped into sequences, in natural order."""
    groups: dict[str, dict[int, Path]] = {}
    for file in files:
        numbers = list(re.finditer(r"\d+", file.stem))
        stem, number = (
            (file.stem[: numbers[-1].start()] + file.stem[numbers[-1].end() :], int(numbers[-1].group()))
            if numbers
            else (file.stem, 0)
        )
        name = "/".join([*file.relative_to(folder).parts[:-1], stem.strip("_- ") or "frame"])
        group = groups.setdefault(name, {})
        if number in group:
            raise BadInputError(
                f"{group[number].name} and {file.name} in {file.parent} both are frame {number}; "
                "keep one file a frame, or select them by --pattern."
            )
        group[number] = file
    found = []
    for name, group in groups.items():
        order = sorted(group)
        missing = sorted(set(range(order[0], order[-1] + 1)) - set(order))
        found.append(Sequence(name, tuple(group[n] for n in order), tuple(missing)))
    return found


def read_grey(path: Path) -> np.ndarray:
    """One picture as a grey array in its own bit depth; colour is averaged. Raises BadInputError."""
    with reading(path, "Save it again or leave it out."):
        if path.suffix.lower() in (".tif", ".tiff"):
            image = tifffile.imread(path)
        else:
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.size == 0:
        raise BadInputError(f"{path} is no picture or is cut short; save it again or leave it out.")
    if image.ndim == 3 and image.shape[-1] in (3, 4):
        mean = image[..., :3].mean(axis=-1)
        image = np.rint(mean).astype(image.dtype) if np.issubdtype(image.dtype, np.integer) else mean
    if image.ndim == 3:
        # A burst saved as pages: its mean is the picture (page 2 of our captures is the deviation).
        image = image[0] if len(image) == 2 and image.dtype == np.float32 else image.mean(axis=0)
    if image.ndim != 2:
        raise BadInputError(f"{path} has the shape {image.shape}; expected one grey or colour picture.")
    return np.asarray(image)


def _natural(text: str) -> list[tuple[int, str]]:
    """Sort key: numbers by value, text by letter."""
    return [(int(p), "") if p.isdigit() else (-1, p.lower()) for p in re.split(r"(\d+)", text) if p]
