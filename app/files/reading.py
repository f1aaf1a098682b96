"""The edge of every parser: whatever it raises about a foreign file ends as one sentence that names the file."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic_core import from_json

from app.errors import AirlensError, BadInputError, foreseen


@contextlib.contextmanager
def reading(source: Path | str, what_to_do: str) -> Iterator[None]:
    """Parse `source` inside. Raises BadInputError for every error of a parser, with its line where it tells one.

    Decoders of foreign bytes raise what they like (struct.error, zlib.error, KeyError, RecursionError, ...), so
    that no list of them is whole. What has an operator's words already keeps them.
    """
    try:
        yield
    except AirlensError:
        raise
    except Exception as error:
        if foreseen(error):
            raise BadInputError(str(error)) from error
        raise BadInputError(f"{source} cannot be read ({_in_words(error)}). {what_to_do}") from error


def read_json(path: Path, what_to_do: str) -> dict[str, Any]:
    """The JSON object in a file. Raises BadInputError for other content: NaN, half a character, nested too deep."""
    with reading(path, what_to_do):
        text = path.read_bytes()
    return parse_json(text, path, what_to_do)


def parse_json(text: bytes, path: Path, what_to_do: str) -> dict[str, Any]:
    """The JSON object in the bytes of `path`. Raises BadInputError as `read_json` does."""
    with reading(path, what_to_do):
        content = from_json(text, allow_inf_nan=False)
        if not isinstance(content, dict):
            raise TypeError(f"it holds a {type(content).__name__}; expected an object")
        return content


def inside(folder: Path, name: str) -> Path:
    """A file that another file names, inside `folder`. Raises BadInputError for a path outside it."""
    with contextlib.suppress(OSError, ValueError, RuntimeError):  # a NUL, a loop of links, too long a name
        path = (folder / name).resolve()
        if path.is_relative_to(folder.resolve()):
            return path
    raise BadInputError(f"{name[:200]!r} points outside {folder}. Give a file inside it.")


def _in_words(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "it is nested too deep"
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    if isinstance(error, KeyError):
        return f"{error} is missing"
    words = str(error).split("\n")[0][:300]
    if "integer string conversion" in words:
        return "a number has too many digits"
    return words or type(error).__name__
