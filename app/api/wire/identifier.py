"""An id in a path: one that the service gave, and so one plain word."""

from typing import Annotated

from fastapi import Path

ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"
Identifier = Annotated[str, Path(pattern=ID_PATTERN, description="An id that the service gave.")]
