"""What a file says it holds, read from its headers alone: bombs are refused before anything is unpacked.

Only the standard library and NumPy's header reader are used here, and every loop is bounded, so a refusal
costs a millisecond whatever the file says of itself.
"""

import io
import math
import re
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from app.errors import BadInputError
from app.files.npz import ONE_AT_A_TIME
from app.files.reading import reading
from app.files.uploads.tiff import tiff_pages

Kind = Literal["png", "jpeg", "tiff", "npy", "npz"]
HEAD_BYTES = 64
MEMBERS = 64
SEGMENTS = 200
HEADER_BYTES = 10_000
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}\.npy")
END_OF_DIRECTORY = struct.Struct("<4s4H2LH")


@dataclass(frozen=True)
class Declared:
    """One array as the header declares it."""

    name: str
    shape: tuple[int, ...]
    dtype: str
    unpacked_bytes: int


def kind_of(head: bytes) -> Kind:
    """Return the kind that the first bytes show; what the sender calls the file does not matter."""
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return "png"
    if head.startswith(b"\xff\xd8\xff"):
        return "jpeg"
    if head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return "tiff"
    if head.startswith(b"\x93NUMPY"):
        return "npy"
    if head.startswith(b"PK\x03\x04"):
        return "npz"
    raise BadInputError(
        f"The file begins with {head[:8]!r}, which is none of PNG, JPEG, TIFF, NPY and NPZ. Send one of those."
    )


def check_head(head: bytes, pixels: int) -> Kind:
    """Return the kind; refuse a PNG whose size is too large as soon as its first bytes are here."""
    kind = kind_of(head)
    if kind == "png":
        _png(head, pixels)
    return kind


def declared_arrays(path: Path, kind: Kind, pixels: int, unpacked_bytes: int) -> list[Declared]:
    """Return what the file declares; BadInputError if that is malformed or beyond the limits."""
    with reading("The file", "Write it again."), path.open("rb") as file:
        if kind == "png":
            found = [_png(file.read(HEAD_BYTES), pixels)]
        elif kind == "jpeg":
            found = [_jpeg(file, pixels)]
        elif kind == "tiff":
            found = [
                Declared(f"page{index}", (page.rows, page.cols), page.dtype, page.unpacked_bytes)
                for index, page in enumerate(tiff_pages(file, pixels))
            ]
        elif kind == "npy":
            found = [_npy(file, "array", path.stat().st_size)]
        else:
            found = _npz(file, path.stat().st_size)
    total = sum(array.unpacked_bytes for array in found)
    if total > unpacked_bytes:
        raise BadInputError(
            f"The file would unpack to {total:,} bytes; at most {unpacked_bytes:,} are accepted. "
            "Send a cropped or binned version."
        )
    return found


def _png(head: bytes, pixels: int) -> Declared:
    if len(head) < 33 or head[12:16] != b"IHDR":
        raise BadInputError("The PNG has no header chunk; it is truncated. Write it again.")
    cols, rows, depth, colour = struct.unpack(">2I2B", head[16:26])
    channels = {0: 1, 2: 3, 4: 2, 6: 4}.get(colour, 0)
    if channels == 0 or depth not in (8, 16):
        raise BadInputError(
            f"The PNG has {depth} bits and colour type {colour}; expected 8 or 16 bits, grey or colour."
        )
    if not 0 < rows * cols <= pixels:
        raise BadInputError(
            f"The PNG says it has {cols} x {rows} pixels; at most {pixels:,} are accepted. Crop or bin it."
        )
    return Declared("image", (rows, cols), f"uint{depth}", rows * cols * channels * depth // 8)


def _jpeg(file: BinaryIO, pixels: int) -> Declared:
    """The size in the frame's header, which at most so many segments stand before."""
    file.seek(2)
    for _ in range(SEGMENTS):
        head = file.read(4)
        if len(head) < 4 or head[0] != 0xFF:
            break
        marker, length = head[1], int.from_bytes(head[2:], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            depth, rows, cols, channels = struct.unpack(">BHHB", file.read(6))
            if depth != 8 or channels not in (1, 3) or not 0 < rows * cols <= pixels:
                break
            return Declared("image", (rows, cols), "uint8", rows * cols * channels)
        file.seek(length - 2, io.SEEK_CUR)
    raise BadInputError(
        f"The JPEG tells no size, or one above {pixels:,} pixels; expected 8 bits, grey or colour. Write it again."
    )


def _npy(file: BinaryIO, name: str, size_bytes: int) -> Declared:
    with reading(f"The NPY header of {name!r}", "Save it with numpy.save."):
        version = np.lib.format.read_magic(file)
        readers = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        with ONE_AT_A_TIME:
            shape, _, dtype = readers[version](file, max_header_size=HEADER_BYTES)
        if any(n < 0 for n in shape):
            raise ValueError(f"its shape is {shape}")
    if dtype.kind not in "biuf" or dtype.itemsize > 8 or len(shape) > 4:
        raise BadInputError(
            f"Array {name!r} has type {dtype} and {len(shape)} axes; expected numbers (bool, integer, float) "
            "with at most 4 axes. Objects are never loaded."
        )
    data_bytes = math.prod(shape) * dtype.itemsize
    if file.tell() + data_bytes != size_bytes:
        raise BadInputError(
            f"Array {name!r} declares {data_bytes:,} bytes of data, but {size_bytes - file.tell():,} are "
            "there. Write the file again."
        )
    return Declared(name, tuple(int(n) for n in shape), str(dtype), data_bytes)


def _npz(file: BinaryIO, size_bytes: int) -> list[Declared]:
    _check_directory(file, size_bytes)
    try:
        with zipfile.ZipFile(file) as archive:
            return [_member(archive, info) for info in archive.infolist()]
    except (zipfile.BadZipFile, OSError, EOFError, NotImplementedError, RuntimeError, struct.error) as error:
        raise BadInputError("The NPZ is not a sound archive. Save it with numpy.savez.") from error


def _check_directory(file: BinaryIO, size_bytes: int) -> None:
    """Refuse a directory of a million entries before `zipfile` reads it; NumPy writes no comment."""
    file.seek(max(0, size_bytes - END_OF_DIRECTORY.size))
    tail = file.read()
    if len(tail) < END_OF_DIRECTORY.size or not tail.startswith(b"PK\x05\x06"):
        raise BadInputError("The NPZ has no directory at its end; it is truncated. Save it again.")
    _, _, _, _, entries, directory_bytes, _, _ = END_OF_DIRECTORY.unpack(tail)
    if not 0 < entries <= MEMBERS or directory_bytes > MEMBERS * 512:
        raise BadInputError(f"The NPZ has {entries} entries; expected 1 to {MEMBERS} arrays.")
    file.seek(0)


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Declared:
    if not NAME.fullmatch(info.filename) or info.flag_bits & 1:
        raise BadInputError(
            f"The NPZ holds {info.filename[:40]!r}; expected plain arrays named like 'T.npy'."
        )
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise BadInputError(f"{info.filename!r} is packed by an unknown method; use numpy.savez_compressed.")
    with archive.open(info) as member:
        head = io.BytesIO(member.read(HEADER_BYTES))
    return _npy(head, info.filename.removesuffix(".npy"), info.file_size)
