"""Pictures that another camera took, as a camera: the same burst, verdicts and folder come of them.

TIFF (also of many pages), PNG, JPEG, BMP and PGM of 8 or 16 bits; a camera's raw files with the extra `raw` (rawpy).
Colour becomes grey: a pattern has no colour.
"""

import glob
from collections.abc import Generator, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import tifffile

from app.errors import BadInputError
from app.files.image_folder import SUFFIXES, find_images
from app.files.npz import read_npy
from app.files.provenance import sha256
from app.files.reading import reading
from drivers.errors import DeviceNotFoundError, DeviceSettingError
from drivers.protocols import CameraInfo, Frame, Pixels

RAW_SUFFIXES = {".dng", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".rw2", ".orf", ".pef"}
LOSSY_SUFFIXES = {".jpg", ".jpeg"}
LARGEST_PX = 400_000_000
# What 14 bits hold: beyond it a file of 16 bits is one of a camera of more bits, or counts were shifted up.
FEWER_BITS_COUNTS = 2**14 - 1
# Grey in the file's own bits, not turned by what the file says of how the camera was held: a calibration is not.
_AS_THE_SENSOR = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def picture_files(names: list[str]) -> list[Path]:
    """The files of these names: files, folders, or patterns such as `flow/*.png`. Raises BadInputError."""
    found: list[Path] = []
    for name in names:
        path = Path(name)
        if path.is_dir():
            found += find_images(path)
            continue
        matching = [path] if path.is_file() else sorted(Path(one) for one in glob.glob(name))
        if not matching:
            raise BadInputError(
                f'There is no picture {name}. Give a file, a folder, or a pattern in quotes: "flow/*.png".'
            )
        found += matching
    for path in found:
        if path.suffix.lower() not in SUFFIXES | RAW_SUFFIXES:
            raise BadInputError(f"{path} is no picture that can be read: expected {_known()}.")
    if len(set(found)) < len(found):
        raise BadInputError("A picture is named twice, and would count as two frames. Name each one once.")
    return found


class PictureFiles:
    """A camera whose frames are the pictures of some files, one after the other. `frames` counts them.

    `highest_counts` is that of the first picture.
    `called` says what their owner calls files that lie here under other names.
    """

    def __init__(
        self, files: list[Path], bits: int | None = None, called: Mapping[Path, str] | None = None
    ) -> None:
        self._files, self._bits, self._taken = files, bits, 0
        self._called = called or {}
        self._pages = self._frames()
        first = next(self._frames(), None)
        if first is None:
            raise BadInputError(f"{self._said(files[0])} holds no picture. Export it again.")
        self._shape, self._itemsize = first.shape, first.itemsize
        self.highest_counts = int(first.max(initial=0))

    @property
    def exposure_s(self) -> float | None:
        """Unknown."""
        return None

    @exposure_s.setter
    def exposure_s(self, value: float) -> None:
        raise DeviceSettingError(f"Pictures from files have no exposure to set to {value:g} s.")

    @property
    def gain(self) -> float | None:
        """Unknown."""
        return None

    @gain.setter
    def gain(self, value: float) -> None:
        raise DeviceSettingError(f"Pictures from files have no gain to set to {value:g}.")

    @cached_property
    def frames(self) -> int:
        """Pictures in all files; a TIFF may hold many."""
        return sum(_pages_in(file) for file in self._files)

    @property
    def info(self) -> CameraInfo:
        """Size and bits as the first picture has them."""
        rows, columns = self._shape
        return CameraInfo("pictures from files", columns, rows, self._bits or 8 * self._itemsize, 1.0)

    @property
    def origin(self) -> dict[str, Any]:
        """Where the frames come from, for the capture's manifest."""
        files = [{"name": self._called.get(f, f.name), "sha256": sha256(f)} for f in self._files]
        return {"rig": "imported", "files": files}

    @property
    def lossy(self) -> bool:
        """Whether a file was compressed so that fine shifts may be lost."""
        return any(file.suffix.lower() in LOSSY_SUFFIXES for file in self._files)

    @property
    def may_have_fewer_bits(self) -> bool:
        """Whether nobody said how many bits the camera has, and its counts fit in fewer than the files have."""
        return self._bits is None and self._itemsize > 1 and self.highest_counts <= FEWER_BITS_COUNTS

    def grab(self) -> Frame:
        """The next picture. Raises BadInputError for one that cannot be read, DeviceNotFoundError after the last."""
        try:
            pixels = next(self._pages)
        except StopIteration:
            raise DeviceNotFoundError("There are no more pictures.") from None
        self._taken += 1
        return Frame(pixels, self._taken, float(self._taken), 2**self.info.bits - 1)

    follow = grab

    def reconnect(self) -> None:
        """Begin again with the first picture."""
        self._pages, self._taken = self._frames(), 0

    def close(self) -> None:
        """Close the file that is open."""
        self._pages.close()

    def __enter__(self) -> "PictureFiles":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _frames(self) -> Generator[Pixels, None, None]:
        first = None
        for file in self._files:
            said = self._said(file)
            for pixels in _read(file, said):
                first = pixels if first is None else first
                self._check(said, pixels, first)
                yield pixels

    def _said(self, file: Path) -> str:
        return self._called.get(file, str(file))

    def _check(self, said: str, pixels: Pixels, first: Pixels) -> None:
        if pixels.shape != first.shape:
            raise BadInputError(
                f"{said} has {pixels.shape[1]} x {pixels.shape[0]} px, the first picture {first.shape[1]} x "
                f"{first.shape[0]}. Take all pictures with one camera at one size."
            )
        if pixels.dtype != first.dtype:
            raise BadInputError(
                f"{said} has {8 * pixels.itemsize} bits a pixel, the first picture {8 * first.itemsize}. Export all "
                "pictures alike, from the camera's own counts."
            )
        if self._bits is not None and pixels.max(initial=0) > 2**self._bits - 1:
            raise BadInputError(
                f"{said} holds {pixels.max()} counts; {self._bits} bits hold at most {2**self._bits - 1}. "
                "Give the bits of the camera's counts."
            )


def _read(file: Path, said: str) -> Iterator[Pixels]:
    with reading(said, "It may be truncated: export it again."):
        if file.suffix.lower() in RAW_SUFFIXES:
            yield _read_raw(file)
        elif file.suffix == ".npy":
            yield _counts(said, read_npy(file))
        elif file.suffix.lower() in (".tif", ".tiff"):
            yield from _read_tiff(file, said)
        else:
            pixels = cv2.imdecode(np.fromfile(file, np.uint8), _AS_THE_SENSOR)
            if pixels is None:
                raise ValueError("no picture in it")
            yield _counts(said, pixels)


def _read_tiff(file: Path, said: str) -> Iterator[Pixels]:
    with tifffile.TiffFile(file) as opened:
        for page in opened.pages:
            if page.aspage().size > LARGEST_PX:
                raise BadInputError(f"{said} has more than {LARGEST_PX:,} pixels. Crop it.")
            yield _counts(said, page.asarray())


def _counts(said: str, pixels: np.ndarray) -> Pixels:
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4) and pixels.dtype in (np.uint8, np.uint16):
        pixels = cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_RGB2GRAY)
    if pixels.ndim != 2 or pixels.dtype not in (np.uint8, np.uint16):
        raise BadInputError(
            f"{said} holds {pixels.dtype} of shape {pixels.shape}; expected pictures of 8 or 16 bits, grey or "
            "colour. Export the camera's counts without scaling them."
        )
    return pixels


def _read_raw(file: Path) -> Pixels:
    """The green of a camera's raw file, black at 0 and white at 65535, as its sensor has it: linear, not turned.

    Where a pixel has no green its neighbours' mean stands: nothing there depends on the noise but linearly.
    """
    rawpy = _rawpy()
    with rawpy.imread(str(file)) as raw:
        colour = raw.postprocess(
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
            output_color=rawpy.ColorSpace.raw,
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0.0,  # else a picture's own maximum would set its scale
            output_bps=16,
            user_wb=[1.0] * 4,
            user_flip=0,
        )
    return np.ascontiguousarray(colour[..., min(1, colour.shape[2] - 1)])


def _rawpy() -> ModuleType:
    try:
        import rawpy
    except ImportError:
        raise BadInputError(
            "A camera's raw files need rawpy, which is not installed. Run: pip install 'airlens[raw]', or "
            "rawpy alone. Or export the pictures as TIFF of 16 bits, linear, without noise reduction."
        ) from None
    return rawpy


def _pages_in(file: Path) -> int:
    if file.suffix.lower() not in (".tif", ".tiff"):
        return 1
    with reading(file, "It may be truncated: export it again."), tifffile.TiffFile(file) as opened:
        return len(opened.pages)


def _known() -> str:
    return ", ".join(sorted(SUFFIXES | RAW_SUFFIXES))
