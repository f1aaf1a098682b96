"""JSON to dataclasses: rows of numbers are read as they are, and one wrong number among them is named."""

import re
from dataclasses import dataclass

import pytest

from calibration.errors import BundleError
from calibration.strict import decode, encode

NAN = float("nan")


@dataclass(frozen=True)
class Corners:
    free: tuple[tuple[float, ...], ...] = ()
    pairs: tuple[tuple[float, float], ...] = ()
    counted: tuple[tuple[int, ...], ...] = ()


def test_rows_come_back_as_they_were_and_whole_numbers_as_floats():
    kept = Corners(((1.5, 2.0, 3.0), ()), ((0.1, 0.2),), ((1, 2), (3,)))
    assert decode(Corners, {**encode(kept), "pairs": [[0.1, 0.2]]}, "corners") == kept
    (row,) = decode(Corners, {"free": [[1, 2]]}, "corners").free
    assert [type(number) for number in row] == [float, float]


@pytest.mark.parametrize(
    ("name", "rows", "said"),
    [
        ("free", [[1.0], [2.0, "3"]], "corners.free[1][1] is '3'; expected a finite number"),
        ("free", [[1.0], [NAN]], "corners.free[1][0] is nan; expected a finite number"),
        ("free", [[1.0], [True]], "corners.free[1][0] is True; expected a finite number"),
        ("free", [[1.0], 2.0], "corners.free[1] is 2.0; expected a list"),
        ("pairs", [[1.0, 2.0], [1.0]], "corners.pairs[1] is [1.0]; expected a list of 2"),
        ("counted", [[1], [1.5]], "corners.counted[1][0] is 1.5; expected a whole number"),
    ],
)
def test_one_wrong_entry_among_rows_is_named(name: str, rows: list, said: str):
    with pytest.raises(BundleError, match=re.escape(said)):
        decode(Corners, {name: rows}, "corners")
