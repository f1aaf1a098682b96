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
    return decode_image(path.read_bytes(), path)


def decode_image(content: bytes, path: Path) -> BurstImage:
    """The image in the bytes of a file; `path` names it in messages. Raises BadInputError."""
    try:
        with tifffile.TiffFile(io.BytesIO(content)) as file:
            mean, std = (page.asarray() for page in file.pages)
            about: dict[str, Any] = json.loads(file.pages.first.description)
        return BurstImage(mean, std, int(about["frames"]))
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        IndexError,
        struct.error,
        tifffile.TiffFileError,
    ) as error:
        raise BadInputError(
            f"{path} is not a capture's image ({error}); expected a TIFF of two pages, mean and standard "
            "deviation. Take the capture again, or restore the file from a copy."
        ) from None


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
