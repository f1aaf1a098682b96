"""What the report's answer claims, and what it leaves open."""

import pytest

from app.report.answer import ventilates
from app.report.indoor import Quantity


@pytest.mark.parametrize(
    ("value", "low", "high", "words"),
    [
        (60.0, 52.0, 68.0, "better than"),
        (56.0, 35.0, 74.0, "as far as can be told"),
        (40.0, 31.0, 49.0, "worse than"),
        (60.0, None, None, "better than"),
        (50.0, None, None, "as far as can be told"),
    ],
)
def test_a_room_is_compared_with_a_mixed_one_only_where_its_interval_says_so(value, low, high, words):
    told = ventilates(Quantity("efficiency", "air change efficiency", "%", value, low, high))
    assert words in told
    assert "mixed: 50 %" in told
