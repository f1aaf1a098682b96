"""Reading pictures from disk, strictly: TIFF or PNG, one channel, 8 or 16 bit (or a capture's float mean)."""

from pathlib import Path

import cv2
import numpy as np
import tifffile
from jaxtyping import Float32

from app.errors import BadInputError
from app.files.reading import reading

LARGEST_PX = 400_000_000


def read_picture(path: Path) -> Float32[np.ndarray, "rows cols"]:
    """The picture in parts of full scale (float images as they are). Raises BadInputError."""
    if not path.is_file():
        raise BadInputError(f"There is no picture {path}. Give a TIFF or PNG file.")
    with reading(path, "Give a TIFF or PNG; this one may be truncated. Export it again."):
        pixels = _read_tiff(path) if path.suffix.lower() in (".tif", ".tiff") else _read_png(path)
    if pixels.ndim != 2:
        raise BadInputError(
            f"{path} has shape {pixels.shape}; expected one channel. Convert it to grey without rescaling."
        )
    if pixels.dtype not in (np.uint8, np.uint16, np.float32):
        raise BadInputError(f"{path} holds {pixels.dtype} pixels; expected 8 or 16 bit, or 32-bit float.")
    if not np.isfinite(pixels).all():
        raise BadInputError(f"{path} holds values that are not finite.")
    if pixels.dtype == np.float32:
        return pixels
    return (pixels / np.float32(np.iinfo(pixels.dtype).max)).astype(np.float32)


def _read_tiff(path: Path) -> np.ndarray:
    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        if page.size > LARGEST_PX:
            raise ValueError(f"{page.size} pixels")
        return page.asarray()


def _read_png(path: Path) -> np.ndarray:
    pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("no picture in it")
    return pixels
