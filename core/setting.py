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
    cls.__pydantic_config__ = {"extra": "forbid", "strict": True, "use_attribute_docstrings": True}  # type: ignore[attr-defined]
    return dataclass(frozen=True, kw_only=True)(cls)


Number = float | int


def check_range(what: str, value: Number, low: Number, high: Number, unit: str, advice: str) -> None:
    """Refuse a value outside low to high, ends included; NaN is outside. Raises SettingError."""
    if not low <= value <= high:
        raise SettingError(
            f"{what} is {_shown(value)} {unit}".rstrip()
            + f"; expected {low:g} to {high:g} {unit}".rstrip()
            + f". {advice}"
        )


def check_kelvin(what: str, temperature_k: Number) -> None:
    """Refuse what is no temperature of air in kelvin, Celsius above all. Raises SettingError."""
    check_range(what, temperature_k, 150.0, 5000.0, "K", "Give kelvin (20 degrees Celsius is 293.15 K).")


def _shown(value: Number) -> str:
    """The value in a few characters, also a whole number that no float holds."""
    try:
        return f"{value:g}"
    except OverflowError:
        return f"about 1e{round(value.bit_length() * 0.30103)}" if isinstance(value, int) else str(value)
