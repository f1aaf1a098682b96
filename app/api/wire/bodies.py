"""How answers that are not JSON are described in OpenAPI."""

from typing import Any

BINARY = {"schema": {"type": "string", "format": "binary"}}
TEXT = {"schema": {"type": "string"}}
Bodies = dict[int | str, dict[str, Any]]


def body(media_type: str, description: str, text: bool = False) -> Bodies:
    """Return the description of a 200 answer of `media_type`."""
    return {200: {"description": description, "content": {media_type: TEXT if text else BINARY}}}
