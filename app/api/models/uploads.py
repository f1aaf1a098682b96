"""Files that were received."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import WireModel


class UploadedArray(WireModel):
    """One array of an upload."""

    name: str
    shape: list[int]
    dtype: str
    minimum: float
    maximum: float
    mean: float
    nonfinite: int


class Upload(WireModel):
    """A file that was checked, read and kept; `reason` says why a `broken` one cannot be read any more.

    `name` is what its sender calls it.
    """

    upload: str
    name: str = ""
    kind: Literal["png", "jpeg", "tiff", "npy", "npz", "broken"]
    bytes: int = 0
    sha256: str = ""
    received_s: float = 0.0
    arrays: list[UploadedArray] = Field(default_factory=list)
    reason: str = ""
