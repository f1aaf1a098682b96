"""One row of the table of extremes: a stage on a scene at its limits, and what must come of it.

A row ends in a number within a tolerance, in a named outcome, or in a refusal that says what was given and
what to do. NaN, an infinity, another exception or a warning is a failure, whatever the row expects.
"""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import pytest

from app.errors import BadInputError
from calibration.errors import CalibrationError
from core.setting import SettingError
from drivers.errors import DeviceError
from tests.extremes.summary import PROPERTY

REFUSALS = (SettingError, BadInputError, CalibrationError, DeviceError)


@dataclass(frozen=True)
class Near:
    """Every number of the answer within |expected| rel + abs of it (or of the array of them)."""

    value: Any
    rel: float = 0.0
    abs: float = 0.0

    def __str__(self) -> str:
        size = f"{self.value:.4g}" if np.ndim(self.value) == 0 else f"{np.size(self.value)} numbers"
        return f"{size} to {self.rel:g} rel, {self.abs:g} abs"


@dataclass(frozen=True)
class Within:
    """Every number of the answer from `low` to `high`."""

    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class Named:
    """The answer is this word, or an enumeration's member of this name."""

    name: str

    def __str__(self) -> str:
        return f"named {self.name!r}"


@dataclass(frozen=True)
class Refused:
    """A refusal of ours whose sentence holds `words` (a regular expression)."""

    words: str

    def __str__(self) -> str:
        return f"refused: {self.words!r}"


Expected = Near | Within | Named | Refused


@dataclass(frozen=True)
class Row:
    """`run` works the stage; nothing is worked out before it is called."""

    stage: str
    scene: str
    run: Callable[[], Any]
    expected: Expected

    def __str__(self) -> str:
        return f"{self.stage}: {self.scene}"


@dataclass(frozen=True)
class Verdict:
    """What came of a row."""

    found: str
    good: bool
    cpu_s: float


def extremes(rows: list[Row]) -> Any:
    """Parametrise a test by rows; a hang is one on the slowest machine, too."""
    mark = pytest.mark.parametrize("row", rows, ids=str)
    return lambda test: pytest.mark.timeout(600)(mark(test))


def prove(row: Row, record_property: Callable[[str, object], None]) -> None:
    """Judge a row and keep it for the report's table."""
    verdict = judge(row)
    record_property(
        PROPERTY,
        {
            "stage": row.stage, "scene": row.scene, "expected": str(row.expected), "found": verdict.found,
            "good": verdict.good, "refusal": isinstance(row.expected, Refused), "cpu_s": verdict.cpu_s,
        },
    )  # fmt: skip
    assert verdict.good, f"{row}: expected {row.expected}, found {verdict.found}"


def judge(row: Row) -> Verdict:
    """Run the row and compare."""
    start = time.process_time()
    try:
        answer = row.run()
    except REFUSALS as refusal:
        good = isinstance(row.expected, Refused) and re.search(row.expected.words, str(refusal)) is not None
        return Verdict(f"{type(refusal).__name__}: {refusal}", good, time.process_time() - start)
    found, good = _compared(answer, row.expected)
    return Verdict(found, good, time.process_time() - start)


def _compared(answer: Any, expected: Expected) -> tuple[str, bool]:
    if isinstance(answer, str | Enum):
        name = answer if isinstance(answer, str) else answer.name
        return name, isinstance(expected, Named) and name == expected.name
    numbers = np.asarray(answer, np.float64)
    found = f"{float(numbers):.6g}" if numbers.ndim == 0 else f"{numbers.size} numbers"
    if numbers.size == 0 or not np.isfinite(numbers).all():
        return f"{found}, not all finite", False
    match expected:
        case Near():
            distance = np.abs(numbers - np.asarray(expected.value, np.float64))
            allowed = expected.rel * np.abs(np.asarray(expected.value, np.float64)) + expected.abs
            worst = float(np.max(distance - allowed))
            return f"{found}, off by at most {distance.max():.3g}", worst <= 0
        case Within():
            low, high = float(numbers.min()), float(numbers.max())
            return f"{low:.4g} to {high:.4g}", expected.low <= low and high <= expected.high
        case _:
            return f"accepted: {found}", False
