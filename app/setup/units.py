"""What a person writes, "18 C" or "120 m3/h", to SI: every value has its unit beside it."""

import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_before_validator_function

# Unit to (factor, offset): SI = factor * value + offset.
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "length": {
        "m": (1.0, 0.0),
        "cm": (1e-2, 0.0),
        "mm": (1e-3, 0.0),
        "um": (1e-6, 0.0),
        "ft": (0.3048, 0.0),
        "in": (0.0254, 0.0),
    },
    "temperature": {"C": (1.0, 273.15), "K": (1.0, 0.0), "F": (5 / 9, 459.67 * 5 / 9)},
    "temperature difference": {"K": (1.0, 0.0), "C": (1.0, 0.0), "F": (5 / 9, 0.0)},
    "volume flow": {
        "m3/h": (1 / 3600, 0.0),
        "m3/s": (1.0, 0.0),
        "l/s": (1e-3, 0.0),
        "cfm": (0.3048**3 / 60, 0.0),
    },
    "speed": {"m/s": (1.0, 0.0), "cm/s": (1e-2, 0.0), "mm/s": (1e-3, 0.0), "fpm": (0.3048 / 60, 0.0)},
    "time": {"s": (1.0, 0.0), "ms": (1e-3, 0.0)},
    "angle": {"deg": (1.0, 0.0)},
    "share": {"%": (1e-2, 0.0)},
    "power": {"W": (1.0, 0.0), "kW": (1e3, 0.0)},
}
_EXAMPLES = {
    "length": "2.7 m",
    "temperature": "18 C",
    "temperature difference": "0.3 K",
    "volume flow": "120 m3/h",
    "speed": "0.5 m/s",
    "time": "20 ms",
    "angle": "60 deg",
    "share": "5 %",
    "power": "75 W",
}
_WRITTEN = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d.,].*?)?\s*")
# A decimal comma; two commas, or a point beside one, are none.
_COMMA = re.compile(r"\s*[-+]?\d+,\d+(?![.,\d]).*")
# Temperatures of air, walls and heaters in a room.
_COLDEST_K, _HOTTEST_K = 200.0, 800.0


def to_si(text: Any, kind: str) -> float:
    """The SI value of a text such as "45 cm". Raises ValueError: not text, no unit, an unknown unit."""
    units = UNITS[kind]
    known = f"a number and its unit ({', '.join(units)}), such as {_EXAMPLES[kind]!r}"
    if not isinstance(text, str):
        raise ValueError(f"{text!r} is no {kind}; expected {known}, in quotes.")
    if not text.strip():
        raise ValueError(f"it is empty; expected {known}.")
    if _COMMA.fullmatch(text):
        raise ValueError(f"{text!r} has a comma; write {text.strip().replace(',', '.')!r}, with a point.")
    written = _WRITTEN.fullmatch(text)
    if written is None:
        raise ValueError(f"{text!r} is no {kind}; expected {known}.")
    number, unit = float(written[1]), (written[2] or "").replace("°", "")
    if not unit:
        raise ValueError(f"{text!r} has no unit; expected {known}.")
    if unit not in units:
        raise ValueError(f"{unit!r} is no unit of {kind}; expected {known}.")
    factor, offset = units[unit]
    return factor * number + offset


def unit_of(text: str) -> str:
    """The unit behind the number; empty where there is none."""
    written = _WRITTEN.fullmatch(text)
    return "" if written is None else (written[2] or "").replace("°", "")


def _looks_like_kelvin(text: str) -> bool:
    """Whether a temperature in C has the number that a room has in kelvin."""
    written = _WRITTEN.fullmatch(text)
    return written is not None and (written[2] or "").endswith("C") and 250 <= float(written[1]) <= 330


@dataclass(frozen=True)
class Written:
    """A value that is written with its unit and lies in a range (SI, ends included)."""

    kind: str
    low: float
    high: float
    advice: str

    def read(self, text: Any) -> float:
        """The SI value. Raises ValueError."""
        value = to_si(text, self.kind)
        if self.kind == "temperature" and _looks_like_kelvin(text):
            raise ValueError(
                f"{text!r} looks like kelvin: write {value - 273.15:g} K for {value - 546.3:.4g} C. "
                f"Something that is really so hot is written in kelvin: {value:g} K."
            )
        if not self.low <= value <= self.high:
            raise ValueError(f"{text!r} is out of range. {self.advice}")
        return value

    @property
    def range_text(self) -> str:
        """The range in the first of the units."""
        low, unit = self.text(self.low).split(" ")
        return f"{low} to {self.text(self.high).split(' ')[0]} {unit}"

    def text(self, value: float) -> str:
        """An SI value as it is written, in the first of the units."""
        unit, (factor, offset) = next(iter(UNITS[self.kind].items()))
        return f"{(value - offset) / factor:.4g} {unit}"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {"type": "string", "examples": [_EXAMPLES[self.kind]]}


Size = Annotated[
    float, Written("length", 0.1, 100.0, "A room is 0.1 to 100 m long: are these millimetres (4000 mm)?")
]
Length = Annotated[
    float, Written("length", -500.0, 500.0, "It lies within 500 m: are these millimetres (450 mm)?")
]
Distance = Annotated[
    float, Written("length", 1e-7, 500.0, "It is above zero and within 500 m: are these millimetres?")
]
Temperature = Annotated[
    float,
    Written(
        "temperature",
        _COLDEST_K,
        _HOTTEST_K,
        "It lies between -73 C and 527 C: is the unit right (18 C is 291.15 K)?",
    ),
]
Difference = Annotated[
    float, Written("temperature difference", 1e-3, 100.0, "A deviation is 0.001 to 100 K.")
]
Flow = Annotated[
    float, Written("volume flow", 1e-6, 1e3, "A supply brings 0.004 to 3.6 million m3/h: is the unit right?")
]
Speed = Annotated[
    float, Written("speed", -100.0, 100.0, "Air in a room is slower than 100 m/s: is the unit right?")
]
Time = Annotated[float, Written("time", 1e-6, 60.0, "It lies between 0.001 ms and 60 s.")]
# What a lens sees, in degrees across the picture.
LENS = Written("angle", 1.0, 170.0, "A lens sees 1 to 170 degrees.")
Angle = Annotated[float, LENS]
Share = Annotated[float, Written("share", 1e-4, 1.0, "It is 0.01 to 100 %.")]
Power = Annotated[float, Written("power", -1e5, 1e5, "A person gives 75 W: is the unit right?")]
PowerDeviation = Annotated[float, Written("power", 0.1, 1e5, "A deviation is 0.1 W to 100 kW.")]
