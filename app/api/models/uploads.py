"""Files that were received."""

from typing import Literal

from app.api.models.strict import Strict


class UploadedArray(Strict):
    """One array of an upload."""

    name: str
    shape: list[int]
    dtype: str
    minimum: float
    maximum: float
    mean: float
    nonfinite: int


class Upload(Strict):
    """A file that was checked, read and kept."""

    upload: str
    kind: Literal["png", "tiff", "npy", "npz"]
    bytes: int
    sha256: str
    received_s: float
    arrays: list[UploadedArray]
