"""What is answered otherwise, taken over into what there is: part by part, and item by item of a list."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

from pydantic import BaseModel

T = TypeVar("T")


def merged(old: Any, before: Any, after: Any) -> Any:
    """`old` with what differs between `before` and `after`, part by part."""
    if before == after:
        return old
    if type(old) is type(before) is type(after):
        if is_dataclass(old) and not isinstance(old, type):
            names = [one.name for one in fields(old)]
            return replace(old, **_parts(names, old, before, after))
        if isinstance(old, BaseModel):
            return old.model_copy(update=_parts(list(type(old).model_fields), old, before, after))
        if isinstance(old, tuple) and len(old) == len(before) == len(after):
            return tuple(merged(*three) for three in zip(old, before, after, strict=True))
    return after


def _parts(names: list[str], old: Any, before: Any, after: Any) -> dict[str, Any]:
    return {name: merged(*(getattr(one, name) for one in (old, before, after))) for name in names}


def sources(before: Sequence[Any], after: Sequence[Any]) -> dict[int, int]:
    """Which old answer each new one is: an equal one, else those that are left, in their order; more are new."""
    free = list(range(len(before)))
    source: dict[int, int] = {}
    for number, answer in enumerate(after):
        same = next((n for n in free if before[n] == answer), None)
        if same is not None:
            free.remove(same)
            source[number] = same
    for number in range(len(after)):
        if number not in source and free:
            source[number] = free.pop(0)
    return source


def merged_list(
    olds: Sequence[T], source: dict[int, int], before: Sequence[T], after: Sequence[T]
) -> list[T]:
    """What each new answer makes: its old one with what differs in it, or a new one."""
    return [
        cast(T, merged(olds[source[n]], before[source[n]], item)) if n in source else item
        for n, item in enumerate(after)
    ]
