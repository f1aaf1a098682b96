"""What a validator says of foreign data, in an operator's words: a mistake, a sentence, at its line and column."""

import dataclasses
import difflib
import functools
import operator
import re
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from app.files.toml_places import KeyPlace, Path, nearest

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


def explained(
    error: ValidationError, data: Any, kind: Any, source: str, places: Mapping[Path, KeyPlace] | None = None
) -> str:
    """Every mistake in the order of the file, each at its place. `places` is empty where there is no text."""
    return in_file(said_of(error, data, kind), data, source, places or {}) or f"{source}: {error}"


@dataclasses.dataclass(frozen=True)
class Said:
    """A mistake: the path of its field, what is wrong there, and whether the field's key is unknown."""

    path: Path
    message: str
    unknown: bool = False

    @property
    def sentence(self) -> str:
        """The message, which names the key where it is unknown."""
        return f"unknown key {str(self.path[-1])!r}{self.message}" if self.unknown else self.message


def said_of(error: ValidationError, data: Any, kind: Any) -> list[Said]:
    """Every mistake that a validator found in `data`, once each."""
    wrong = _wrong_kinds(data, kind, ())
    mistyped = _mistyped(error, data, kind)
    told: dict[tuple[Path, bool], list[str]] = {}
    for one in error.errors():
        path = _path(one["loc"], data)
        above = next((place for place in wrong if path[: len(place)] == place), None)
        if above is not None:
            told[(*above, "kind"), False] = [wrong[above]]
        elif path not in mistyped and _concerns(one["loc"], data, kind):
            said = told.setdefault((path, one["type"] in _UNKNOWN), [])
            said += [message for message in [_message(one, kind)] if message not in said]
    return [Said(path, " or ".join(said), unknown) for (path, unknown), said in told.items()]


def in_file(said: Sequence[Said], data: Any, source: str, places: Mapping[Path, KeyPlace]) -> str:
    """Mistakes in the order of the file, each at its line and column; empty for none."""
    sentences = [
        (
            _place(one.path, one.message, one.unknown, data, places),
            _sentence(one.path, one.message, one.unknown),
        )
        for one in said
    ]
    return _joined(source, sorted(sentences, key=lambda one: one[0] or (0, 0)))


def _mistyped(error: ValidationError, data: Any, kind: Any) -> set[Path]:
    """The keys that are missing because they stand there under another name, which is told."""
    unknown = [one["loc"] for one in error.errors() if one["type"] in _UNKNOWN]
    meant = {(*_path(loc, data)[:-1], _near(loc, kind)) for loc in unknown}
    missing = {_path(one["loc"], data) for one in error.errors() if one["type"].startswith("missing")}
    return meant & missing


def _near(location: Sequence[str | int], kind: Any) -> str:
    """The known key that is most like an unknown one."""
    names = _fields_at(kind, location[:-1])
    return next(iter(difflib.get_close_matches(str(location[-1]), names, n=1, cutoff=0.0)), "")


def at_place(source: str, place: tuple[int, int] | None) -> str:
    """`experiment.toml, line 12, column 3`."""
    return source if place is None else f"{source}, line {place[0]}, column {place[1]}"


def _joined(source: str, sentences: Sequence[tuple[tuple[int, int] | None, str]]) -> str:
    parts = []
    for place, sentence in sentences:
        where = at_place(source if not parts else "", place).removeprefix(", ")
        parts.append(f"{where}: {sentence}" if where else sentence)
    return "; ".join(parts)


def _sentence(path: Path, message: str, unknown: bool) -> str:
    name = ".".join(map(str, path))
    if unknown:
        return f"unknown key {name!r}{message}"
    return f"{name}: {message}" if name else message


def _message(error: Any, kind: Any) -> str:
    if error["type"] == "missing":
        return "it is missing; give it"
    if error["type"] not in _UNKNOWN:
        return error["msg"].removeprefix("Value error, ")
    near = _near(error["loc"], kind)
    hint = f"; did you mean {near!r}?" if near else "."
    return f"{hint} Known here: {', '.join(sorted(set(_fields_at(kind, error['loc'][:-1]))))}"


def _place(
    path: Path, message: str, unknown: bool, data: Any, places: Mapping[Path, KeyPlace]
) -> tuple[int, int] | None:
    """Of an unknown key the key, of a wrong value the value, of a table the key that the message names."""
    table = _at(data, path)
    if isinstance(table, dict):
        path = (*path, *_named(table, message)[:1])
    found = nearest(places, path)
    if found is None:
        return None
    there, place = found
    return place.key if unknown or there != path else place.value


def _named(table: Mapping[str, Any], message: str) -> list[str]:
    """The keys that a sentence about their table names, or whose value it tells."""
    by_name = [key for key in table if re.search(rf"\b{re.escape(key)}\b", message)]
    numbers = {key: f"{value:g}" for key, value in table.items() if _is_short(value)}
    return by_name + [key for key, number in numbers.items() if f" is {number} " in message]


def _is_short(value: Any) -> bool:
    """Whether it is a number that a sentence would tell as it is; a whole one may be larger than any float."""
    return isinstance(value, float | int) and abs(value) < 1e15


def _at(data: Any, path: Path) -> Any:
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _path(location: Sequence[str | int], data: Any) -> Path:
    """The keys that a location names, without the members of unions that the validator tells between them."""
    path: list[str | int] = []
    for number, part in enumerate(location):
        last = number == len(location) - 1
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        elif not (last and isinstance(data, list if isinstance(part, int) else dict)) or _is_class_name(part):
            continue
        path.append(part)
    return tuple(path)


def _is_class_name(part: str | int) -> bool:
    return isinstance(part, str) and (part[:1].isupper() or "[" in part)


def _wrong_kinds(data: Any, hint: Any, path: Path) -> dict[Path, str]:
    """Each table whose `kind` is none of those that may stand there, and what may."""
    if isinstance(data, list):
        items = _item_hints(hint)
        return {p: t for n, item in enumerate(data) for p, t in _wrong_kinds(item, items, (*path, n)).items()}
    members = _members(hint)
    if not isinstance(data, dict) or not members:
        return {}
    tags = {tag: member for member in members if (tag := _kind_of(member)) is not None}
    if len(tags) == len(members) > 1:
        given = data.get("kind")
        if not isinstance(given, str) or given not in tags:
            return {path: _no_kind(given, tags)}
        members = [tags[given]]
    found: dict[Path, str] = {}
    for name, inner in typing.get_type_hints(members[0], include_extras=True).items():
        if name in data:
            found |= _wrong_kinds(data[name], inner, (*path, name))
    return found


def _no_kind(given: Any, tags: Mapping[str, Any]) -> str:
    allowed = ", ".join(map(repr, tags))
    if given is None:
        return f"it is missing; expected one of {allowed}"
    near = difflib.get_close_matches(str(given), tags, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{given!r} is not known; expected one of {allowed}{hint}"


def _item_hints(hint: Any) -> Any:
    """What the items of an array may be."""
    if typing.get_origin(hint) is typing.Annotated:
        return _item_hints(typing.get_args(hint)[0])
    arguments = [one for one in typing.get_args(hint) if one is not Ellipsis]
    return functools.reduce(operator.or_, arguments) if arguments else hint


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
    choices = typing.get_args(hints.get("kind"))
    return choices[0] if len(choices) == 1 else None


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
