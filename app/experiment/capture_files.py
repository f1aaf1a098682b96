"""The files of a capture: a TIFF of mean and standard deviation, and an optional BigTIFF of raw frames.

Fiji, ParaView, Python and MATLAB open both unaided. The raw stack is flushed page by page: after a crash
every page that was written can be read, which a plain HDF5 file does not offer.
"""

import io
import json
import os
import struct
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from jaxtyping import Float32

from app.errors import BadInputError
from app.files.durable import write_durably
from app.files.pictures import LARGEST_PX
from app.files.reading import reading
from drivers.burst import FrameRecord
from drivers.protocols import Frame, Pixels

Image = Float32[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class BurstImage:
    """Mean and standard deviation of one frame, in parts of full scale, over `frames` frames."""

    mean: Image
    std: Image
    frames: int


def write_image(path: Path, image: BurstImage) -> None:
    """Write mean (page 1) and standard deviation (page 2) durably."""
    about = {"frames": image.frames, "unit": "parts of full scale"}

    def write(temporary: Path) -> None:
        with tifffile.TiffWriter(temporary) as writer:
            for page, values in (("mean", image.mean), ("standard deviation of one frame", image.std)):
                writer.write(values, description=json.dumps({"page": page} | about), metadata=None)

    write_durably(path, write)


def read_image(path: Path) -> BurstImage:
    """Read what `write_image` wrote. Raises BadInputError when it is something else."""
    with reading(path, "Restore the file from a copy."):
        content = path.read_bytes()
    return decode_image(content, path)


def decode_image(content: bytes, path: Path) -> BurstImage:
    """The image in the bytes of a file; `path` names it in messages. Raises BadInputError."""
    with reading(
        path,
        "A capture's image is a TIFF of two pages, mean and standard deviation. Take the capture again, or "
        "restore the file from a copy.",
    ):
        with tifffile.TiffFile(io.BytesIO(content)) as file:
            if any(page.aspage().size > LARGEST_PX for page in file.pages):
                raise BadInputError(f"{path} says that it has more than {LARGEST_PX:,} pixels. Crop it.")
            mean, std = (page.asarray() for page in file.pages)
            about: dict[str, Any] = json.loads(file.pages.first.description)
        image = BurstImage(mean, std, int(about["frames"]))
        if image.mean.ndim != 2 or image.mean.dtype != np.float32 or image.std.shape != image.mean.shape:
            raise BadInputError(
                f"{path} holds {mean.dtype} of shape {mean.shape}; expected one grey picture."
            )
        return image


class RawStack:
    """Raw frames, page by page, each with its own metadata; readable up to the last page after a crash."""

    def __init__(self, path: Path) -> None:
        self._writer = tifffile.TiffWriter(path, bigtiff=True)

    def add(self, frame: Frame, record: FrameRecord) -> None:
        """Append one frame as the camera gave it."""
        self._writer.write(frame.pixels, description=json.dumps(asdict(record)), metadata=None)
        self._writer.filehandle.flush()

    def close(self) -> None:
        """Flush to the disk and close."""
        self._writer.filehandle.flush()
        os.fsync(self._writer.filehandle.fileno())
        self._writer.close()


def read_raw_stack(path: Path) -> tuple[list[Pixels], list[FrameRecord]]:
    """Return the frames and records of a raw stack; of one that a crash cut short, those before the cut."""
    frames: list[Pixels] = []
    records: list[FrameRecord] = []
    with tifffile.TiffFile(path) as file:
        try:
            for page in file.pages:
                record = FrameRecord(**json.loads(page.aspage().description))
                frames.append(page.asarray())
                records.append(record)
        except (ValueError, TypeError, KeyError, struct.error, tifffile.TiffFileError):
            # The page that was being written when the process died: everything before it is whole.
            return frames, records
    return frames, records
