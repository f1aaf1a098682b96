"""A TIFF's pages from its directories alone, with every count bounded and every loop broken."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from app.errors import BadInputError

PAGES = 256
ENTRIES = 64
WIDTH, LENGTH, BITS, COMPRESSION, SAMPLES, FORMAT = 256, 257, 258, 259, 277, 339
# A volume in one page: how many images deep, and how large its tiles are.
DEPTH, TILE_WIDTH, TILE_LENGTH, TILE_DEPTH = 32997, 322, 323, 32998
READ = (WIDTH, LENGTH, BITS, COMPRESSION, SAMPLES, FORMAT, DEPTH, TILE_WIDTH, TILE_LENGTH, TILE_DEPTH)
# None, LZW, deflate (two names), PackBits: what tifffile reads without further libraries.
COMPRESSIONS = (1, 5, 8, 32946, 32773)
FORMATS = {1: "uint", 2: "int", 3: "float"}


@dataclass(frozen=True)
class Page:
    """One image as its directory declares it."""

    rows: int
    cols: int
    dtype: str
    unpacked_bytes: int


@dataclass(frozen=True)
class _Layout:
    """Where numbers are in a classic or a big TIFF."""

    order: str
    big: bool

    @property
    def entry(self) -> struct.Struct:
        return struct.Struct(self.order + ("HHQ8s" if self.big else "HHL4s"))


def tiff_pages(file: BinaryIO, pixels: int) -> list[Page]:
    """Return the pages; BadInputError for a loop, too many pages or entries, or too large an image."""
    return [_page(tags, pixels) for tags in _directories(file)]


def _directories(file: BinaryIO) -> Iterator[dict[int, int]]:
    try:
        layout, offset = _start(file.read(16))
        seen: set[int] = set()
        while offset:
            if offset in seen or len(seen) >= PAGES:
                raise BadInputError(f"The TIFF has a loop or more than {PAGES} pages. Send fewer frames.")
            seen.add(offset)
            file.seek(offset)
            tags, offset = _directory(file, layout)
            yield tags
    except (struct.error, OverflowError, OSError) as error:
        raise BadInputError("The TIFF's directory is cut off or damaged. Write the file again.") from error


def _start(head: bytes) -> tuple[_Layout, int]:
    order = "<" if head[:2] == b"II" else ">"
    big = struct.unpack(order + "H", head[2:4])[0] == 43
    return _Layout(order, big), struct.unpack(
        order + ("Q" if big else "L"), head[8:16] if big else head[4:8]
    )[0]


def _directory(file: BinaryIO, layout: _Layout) -> tuple[dict[int, int], int]:
    count_format = layout.order + ("Q" if layout.big else "H")
    (entries,) = struct.unpack(count_format, file.read(struct.calcsize(count_format)))
    if not 0 < entries <= ENTRIES:
        raise BadInputError(f"A TIFF page has {entries} entries; expected 1 to {ENTRIES}. Write it again.")
    raw = file.read(entries * layout.entry.size)
    tags: dict[int, int] = {}
    for tag, kind, count, value in layout.entry.iter_unpack(raw):
        if tag in READ:
            tags[tag] = _number(file, layout, kind, count, value)
    next_format = layout.order + ("Q" if layout.big else "L")
    return tags, struct.unpack(next_format, file.read(struct.calcsize(next_format)))[0]


def _number(file: BinaryIO, layout: _Layout, kind: int, count: int, value: bytes) -> int:
    """Return the entry's first number; where several do not fit into the entry, it holds their place."""
    code = {1: "B", 3: "H", 4: "L", 16: "Q"}.get(kind)
    if code is None or not 0 < count <= 16:
        raise BadInputError("A TIFF page declares its size in an unusual way. Write it again, uncompressed.")
    size = struct.calcsize("=" + code)
    if size * count > len(value):
        here = file.tell()
        file.seek(struct.unpack(layout.order + ("Q" if layout.big else "L"), value)[0])
        value = file.read(size)
        file.seek(here)
    return struct.unpack(layout.order + code, value[:size])[0]


def _page(tags: dict[int, int], pixels: int) -> Page:
    rows, cols = tags.get(LENGTH, 0), tags.get(WIDTH, 0)
    bits, samples = tags.get(BITS, 1), tags.get(SAMPLES, 1)
    if tags.get(DEPTH, 1) != 1 or tags.get(TILE_DEPTH, 1) != 1:
        raise BadInputError(
            f"A TIFF page is {tags.get(DEPTH, 1)} images deep; expected flat pages. Write one page an image."
        )
    if max(tags.get(TILE_WIDTH, 0), 1) * max(tags.get(TILE_LENGTH, 0), 1) > pixels:
        raise BadInputError("A TIFF page has tiles larger than an image may be. Write it again.")
    if not 0 < rows * cols <= pixels:
        raise BadInputError(
            f"A TIFF page says it has {cols} x {rows} pixels; at most {pixels:,} are accepted. Crop it."
        )
    if bits not in (8, 16, 32, 64) or not 1 <= samples <= 4 or tags.get(FORMAT, 1) not in FORMATS:
        raise BadInputError(
            f"A TIFF page has {bits} bits and {samples} samples; expected 8 to 64 bits, 1 to 4 samples."
        )
    if tags.get(COMPRESSION, 1) not in COMPRESSIONS:
        raise BadInputError(
            f"The TIFF is packed by method {tags[COMPRESSION]}; expected none, LZW, deflate or PackBits."
        )
    dtype = f"{FORMATS[tags.get(FORMAT, 1)]}{bits}"
    return Page(rows, cols, dtype, rows * cols * samples * bits // 8)
