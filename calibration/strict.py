"""Frozen dataclasses to plain JSON values and back, strictly: unknown, missing and mistyped keys are named.

Knows what a bundle holds: numbers, text, truth values, `Literal`, tuples, dictionaries with text keys,
dataclasses, and any of these or None.
"""

import dataclasses
import difflib
import json
import math
import types
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from calibration.errors import BundleError

T = TypeVar("T")


def encode(value: Any) -> Any:
    """A dataclass tree as dictionaries, lists, numbers and text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: encode(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): encode(item) for key, item in value.items()}
    if isinstance(value, tuple):
        plain = all(type(item) in (float, int, str) for item in value)
        return list(value) if plain else [encode(item) for item in value]
    return value


def decode(cls: type[T], content: Any, where: str) -> T:
    """Build the dataclass `cls` from JSON values; `where` names the place in messages.

    Raises:
        BundleError: an unknown or missing key, or a value of the wrong type.
    """
    if not isinstance(content, dict):
        raise BundleError(f"{where} is {_shown(content)}; expected a table of keys.")
    hints = get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    for key in content:
        if key not in fields:
            near = difflib.get_close_matches(key, fields, n=1)
            hint = f"Did you mean {near[0]!r}?" if near else f"Known keys: {', '.join(fields)}."
            raise BundleError(f"{where} has the unknown key {key!r}. {hint}")
    for name, field in fields.items():
        no_default = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if no_default and name not in content:
            raise BundleError(f"{where} lacks the key {name!r}; add it or calibrate again.")
    try:
        return cls(**{key: _value(hints[key], item, f"{where}.{key}") for key, item in content.items()})
    except BundleError:
        raise
    except ValueError as error:
        raise BundleError(f"{where}: {error}") from error


def from_json(cls: type[T], text: str, source: str, remedy: str) -> T:
    """Build the dataclass `cls` from JSON text; `source` names it in messages, and `remedy` says what to do.

    Raises:
        BundleError: not JSON, an unknown or missing key, a wrong type.
    """
    try:
        content = json.loads(text)
    except ValueError as error:
        raise BundleError(f"{source} is not JSON ({error}). {remedy}") from error
    return decode(cls, content, source)


def _value(hint: Any, item: Any, where: str) -> Any:
    """One value as its annotation says."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if item is None and type(None) in arguments:
            return None
        return _value(next(a for a in arguments if a is not type(None)), item, where)
    if origin is Literal:
        return _expect(item in arguments, item, where, f"one of {', '.join(map(repr, arguments))}")
    if origin is tuple:
        return _tuple(arguments, item, where)
    if origin is dict:
        _expect(isinstance(item, dict), item, where, "a table")
        return {key: _value(arguments[1], entry, f"{where}.{key}") for key, entry in item.items()}
    if dataclasses.is_dataclass(hint):
        return decode(hint, item, where)  # type: ignore[arg-type]
    if hint is float:
        number = isinstance(item, int | float) and not isinstance(item, bool) and math.isfinite(item)
        return float(_expect(number, item, where, "a finite number"))
    right = isinstance(item, hint) and (hint is bool or not isinstance(item, bool))
    return _expect(right, item, where, {int: "a whole number", str: "text", bool: "true or false"}[hint])


def _tuple(arguments: tuple[Any, ...], item: Any, where: str) -> tuple[Any, ...]:
    """A list as a tuple of fixed or free length."""
    _expect(isinstance(item, list), item, where, "a list")
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        kinds = (arguments[0],) * len(item)
    else:
        kinds = arguments
        _expect(len(item) == len(kinds), item, where, f"a list of {len(kinds)}")
    if _are_rows(kinds, item):
        return tuple(tuple(map(float, row)) for row in item)
    return tuple(
        _value(kind, entry, f"{where}[{i}]") for i, (kind, entry) in enumerate(zip(kinds, item, strict=True))
    )


def _are_rows(kinds: tuple[Any, ...], item: list[Any]) -> bool:
    """Whether all entries are rows of finite numbers, as they should be: corners are thousands, and read often."""
    if not kinds or get_origin(kinds[0]) is not tuple or kinds.count(kinds[0]) < len(kinds):
        return False
    row: tuple[Any, ...] = get_args(kinds[0])
    entries: list[Any] = item
    return set(row) <= {float, Ellipsis} and all(
        isinstance(entry, list)
        and (Ellipsis in row or len(entry) == len(row))
        and all(type(x) in (float, int) and math.isfinite(x) for x in entry)
        for entry in entries
    )


def _expect(right: bool, item: Any, where: str, expected: str) -> Any:
    if not right:
        raise BundleError(f"{where} is {_shown(item)}; expected {expected}.")
    return item


def _shown(item: Any) -> str:
    text = repr(item)
    return text if len(text) <= 40 else text[:37] + "..."
