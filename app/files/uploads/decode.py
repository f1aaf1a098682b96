"""Reads the arrays of one file and writes them as NPY; runs in the limited child only."""

from pathlib import Path
from typing import Any

import numpy as np


def decode(kind: str, source: Path, folder: Path) -> list[dict[str, Any]]:
    """Write `folder/NAME.npy` for every array in `source`; return name, shape, type and range of each."""
    readers = {"png": _image, "jpeg": _image, "tiff": _tiff, "npy": _npy, "npz": _npz}
    found = []
    for name, array in readers[kind](source).items():
        np.save(folder / f"{name}.npy", array, allow_pickle=False)
        found.append(_summary(name, array))
    return found


def _summary(name: str, array: np.ndarray) -> dict[str, Any]:
    finite = array[np.isfinite(array)] if array.dtype.kind == "f" else array
    span = (
        (float(finite.min()), float(finite.max()), float(finite.mean())) if finite.size else (0.0, 0.0, 0.0)
    )
    return {
        "name": name,
        "shape": list(array.shape),
        "dtype": str(array.dtype),
        "minimum": span[0],
        "maximum": span[1],
        "mean": span[2],
        "nonfinite": int(array.size - finite.size),
    }


def _image(source: Path) -> dict[str, np.ndarray]:
    import cv2

    image = cv2.imread(str(source), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("the picture cannot be decoded")
    return {"image": _grey(image)}


def _tiff(source: Path) -> dict[str, np.ndarray]:
    import tifffile

    with tifffile.TiffFile(source) as file:
        return {f"page{index}": _grey(page.asarray()) for index, page in enumerate(file.pages)}


def _npy(source: Path) -> dict[str, np.ndarray]:
    return {"array": np.load(source, allow_pickle=False)}


def _npz(source: Path) -> dict[str, np.ndarray]:
    with np.load(source, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _grey(image: np.ndarray) -> np.ndarray:
    """A monochrome camera's colour file holds the same counts thrice; a true colour image is averaged."""
    if image.ndim == 2:
        return image
    mean = image[..., :3].mean(-1)
    return np.rint(mean).astype(image.dtype) if image.dtype.kind == "u" else mean.astype(np.float32)
