"""Text to typed configuration and back: strict, and an unknown key is refused with the nearest known one."""

import functools
import json
import re
import threading
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from app.errors import BadInputError
from app.files.reading import reading
from app.files.toml_errors import at_place, explained
from app.files.toml_places import places_of

T = TypeVar("T")
_MAKING = threading.Lock()


class Strict(BaseModel):
    """Base of every model at the edge: frozen, no unknown key, no silent conversion.

    The text below a field is its description, in a JSON Schema and in REFERENCE.md.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True)


def read_toml(path: Path, kind: type[T]) -> T:
    """Parse a TOML file into `kind`. Raises BadInputError that names every wrong key or value."""
    if not path.exists():
        raise BadInputError(f"There is no {path}. Give the folder of an experiment; `airlens new` makes one.")
    with reading(path, "Correct the file at that place."):
        text = path.read_text(encoding="utf-8")
    return from_toml(text, kind, source=str(path))


def from_toml(text: str, kind: type[T], source: str) -> T:
    """Parse TOML text into `kind`. Raises BadInputError that names every wrong key or value."""
    return parse(toml_data(text, source), kind, source, text)


def toml_data(text: str, source: str) -> dict[str, Any]:
    """Plain data of a TOML text. Raises BadInputError with line and column."""
    with reading(source, "Correct the file at that place."):
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise BadInputError(_no_toml(str(error), source)) from None


def parse(data: dict[str, Any], kind: type[T], source: str, text: str = "") -> T:
    """Validate plain data into `kind`; `text` is the TOML that it was read from. Raises BadInputError."""
    try:
        return adapter_of(kind).validate_json(json.dumps(data), strict=True)
    except ValidationError as error:
        raise BadInputError(explained(error, data, kind, source, places_of(text))) from None
    except TypeError as error:
        raise BadInputError(f"{source}: a value has a type that is not allowed here ({error}).") from None


def to_toml(value: Any) -> str:
    """TOML text that `read_toml` reads back to an equal value.

    Nothing and empty arrays are not written: an array's tables can be added below it only where it is not there yet.
    """
    return tomlkit.dumps(_written(to_plain(value)))


def to_plain(value: Any) -> Any:
    """Plain data (dicts, lists, numbers, text) of a model or a setting."""
    return json.loads(adapter_of(type(value)).dump_json(value))


def adapter_of(kind: type[T]) -> TypeAdapter[T]:
    """What checks and writes a kind. One thread at a time makes it: Python 3.11 cannot parse sources in two."""
    with _MAKING:
        return _made(kind)


@functools.cache
def _made(kind: type[T]) -> TypeAdapter[T]:
    return TypeAdapter(kind)


def _written(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _written(v) for k, v in value.items() if v is not None and v != []}
    if isinstance(value, list):
        return [_written(v) for v in value]
    return value


def _no_toml(error: str, source: str) -> str:
    found = re.search(r" \(at line (\d+), column (\d+)\)", error)
    where = at_place(source, (int(found[1]), int(found[2])) if found else None)
    said = error.replace(found[0], "") if found else error
    twice = re.search(r"immutable namespace \((.*)\)", said)
    todo = "Correct the file at that place."
    if twice:
        key = re.findall(r"'([^']*)'", twice[1])[-1]
        todo = f"{key!r} is given twice: delete the line {key} = [], or what stands in its place; keep the tables."
    return f"{where}: it is not valid TOML ({said}). {todo}"
