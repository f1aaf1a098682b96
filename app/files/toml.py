"""Text to typed configuration and back: strict, and an unknown key is refused with the nearest known one."""

import dataclasses
import difflib
import json
import tomllib
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from app.errors import BadInputError
from app.files.reading import reading

T = TypeVar("T")


class Strict(BaseModel):
    """Base of every model at the edge: frozen, no unknown key, no silent conversion.

    The text below a field is its description, in a JSON Schema and in REFERENCE.md.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True)


def read_toml(path: Path, kind: type[T]) -> T:
    """Parse a TOML file into `kind`. Raises BadInputError that names every wrong key or value."""
    if not path.exists():
        raise BadInputError(
            f"There is no {path}. Give the folder of an experiment; `airlens simulate` makes one."
        )
    with reading(path, "Correct the file at that place."):
        text = path.read_text(encoding="utf-8")
    return from_toml(text, kind, source=str(path))


def from_toml(text: str, kind: type[T], source: str) -> T:
    """Parse TOML text into `kind`. Raises BadInputError that names every wrong key or value."""
    with reading(source, "Correct the file at that place."):
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise BadInputError(
                f"{source} is not valid TOML ({error}). Correct the file at that place."
            ) from None
        return parse(data, kind, source)


def parse(data: dict[str, Any], kind: type[T], source: str) -> T:
    """Validate plain data into `kind`. Raises BadInputError."""
    try:
        return TypeAdapter(kind).validate_json(json.dumps(data), strict=True)
    except ValidationError as error:
        problems = [_explain(e, kind) for e in error.errors() if _concerns(e["loc"], data, kind)]
        raise BadInputError(f"{source}: " + "; ".join(problems or [str(error)])) from None
    except TypeError as error:
        raise BadInputError(f"{source}: a value has a type that is not allowed here ({error}).") from None


def to_toml(value: Any) -> str:
    """TOML text that `read_toml` reads back to an equal value."""
    return tomlkit.dumps(_without_none(to_plain(value)))


def to_plain(value: Any) -> Any:
    """Plain data (dicts, lists, numbers, text) of a model or a setting."""
    return json.loads(TypeAdapter(type(value)).dump_json(value))


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list):
        return [_without_none(v) for v in value]
    return value


def _explain(error: Any, kind: Any) -> str:
    place = ".".join(str(part) for part in error["loc"] if not _is_class_name(part))
    if error["type"] not in ("extra_forbidden", "unexpected_keyword_argument"):
        message = error["msg"].removeprefix("Value error, ")
        return f"{place}: {message}" if place else message
    names = _fields_at(kind, error["loc"][:-1])
    near = difflib.get_close_matches(str(error["loc"][-1]), names, n=1, cutoff=0.0)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    return f"unknown key {place!r}{hint} Known here: {', '.join(sorted(names))}"


def _is_class_name(part: str | int) -> bool:
    return isinstance(part, str) and (part[:1].isupper() or "[" in part)


def _concerns(location: Sequence[str | int], data: Any, kind: Any) -> bool:
    """Whether the error is about the member of a union that the data's `kind` names."""
    for part in location:
        if _is_class_name(part):
            member = next((c for c in _classes(kind) if c.__name__ == part), None)
            default = _kind_of(member)
            if isinstance(data, dict) and default is not None and data.get("kind") != default:
                return False
        elif isinstance(data, dict):
            data = data.get(part)
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            return True
    return True


def _kind_of(member: Any) -> str | None:
    hints = typing.get_type_hints(member) if member else {}
    return typing.get_args(hints["kind"])[0] if "kind" in hints else None


def _classes(kind: Any) -> list[Any]:
    """Every settings class below `kind`."""
    found: dict[Any, None] = {}

    def visit(hint: Any) -> None:
        for argument in typing.get_args(hint):
            visit(argument)
        is_model = isinstance(hint, type) and issubclass(hint, BaseModel)
        if (dataclasses.is_dataclass(hint) or is_model) and hint not in found:
            found[hint] = None
            for inner in typing.get_type_hints(hint).values():
                visit(inner)

    visit(kind)
    return list(found)


def _fields_at(kind: Any, location: Sequence[str | int]) -> list[str]:
    """Names of the fields of the class that `location` points to."""
    current: list[Any] = [kind]
    for part in location:
        if isinstance(part, int):
            continue
        members = [m for hint in current for m in _members(hint)]
        named = [m for m in members if getattr(m, "__name__", "") == part]
        if named:
            current = named
        else:
            current = [
                h
                for m in members
                if hasattr(m, "__annotations__")
                for h in [typing.get_type_hints(m).get(part)]
                if h
            ] or current
    members = [m for hint in current for m in _members(hint)]
    return [
        name for m in members for name in typing.get_type_hints(m) if not name.startswith(("_", "model_"))
    ]


def _members(hint: Any) -> list[Any]:
    """The settings classes that a type hint names directly."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType, tuple, list, typing.Annotated):
        return [m for a in typing.get_args(hint) for m in _members(a)]
    is_model = isinstance(hint, type) and (issubclass(hint, BaseModel) or dataclasses.is_dataclass(hint))
    return [hint] if is_model else []
