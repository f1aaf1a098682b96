"""Settings: frozen dataclasses that say what a thing is, checked where they are made.

The edge (`app`) embeds them in its request models. `__pydantic_config__` is a plain attribute that
the edge's validator reads; core itself imports no validator.
"""

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


class SettingError(ValueError):
    """A setting that cannot be: says what was given, what was expected, and what to do."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
def setting(cls: type[T]) -> type[T]:
    """Make `cls` a frozen, keyword-only dataclass that refuses unknown keys at the edge."""
    cls.__pydantic_config__ = {"extra": "forbid", "strict": True}  # type: ignore[attr-defined]
    return dataclass(frozen=True, kw_only=True)(cls)
