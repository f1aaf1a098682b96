"""What is said beside a figure follows from its whole interval, never from its middle alone."""

import pytest

from app.report.indoor import Quantity
from app.report.meaning import meaning, warmth


def of(key: str, value: float, low: float | None = None, high: float | None = None) -> str:
    return meaning(Quantity(key, key, "", value, low, high))


@pytest.mark.parametrize(
    ("key", "value", "low", "high", "words"),
    [
        # ISO 7730:2005, tables A.1 and A.3.
        ("draught_rate_p95", 9.0, 8.0, 9.9, "category A"),
        ("draught_rate_p95", 9.0, 8.0, 12.0, "category A to B"),
        ("draught_rate_p95", 25.0, 21.0, 33.0, "category C or worse"),
        ("draught_rate_p95", 40.0, 31.0, 55.0, "worse than category C"),
        ("head_to_ankle", 2.5, None, None, "category B"),
        ("ppd", 8.0, 7.0, 9.0, "category B"),
        # A vote of nothing is in its interval, so it may be in category A.
        ("pmv", 0.1, -0.6, 0.3, "neither warm nor cool; category A to C"),
        ("pmv", -0.6, -0.65, -0.55, "a little cool; category C"),
        ("efficiency", 60.0, 45.0, 75.0, "not told from mixed"),
        ("zone_index", 1.2, 1.1, 1.3, "better than mixed"),
        ("adpi", 44.0, 41.0, 52.0, "below the 80 % that are wanted"),
        ("temperature_mean", 20.0, 19.0, 21.0, ""),
    ],
)
def test_words_beside_a_figure(key, value, low, high, words):
    assert of(key, value, low, high) == words


def test_the_vote_in_words():
    said = [warmth(vote) for vote in (-3.0, -2.0, -1.0, 0.0, 0.4, 1.0, 2.0, 3.0)]
    assert said == [
        "cold",
        "cool",
        "a little cool",
        "neither warm nor cool",
        "hardly warm",
        "a little warm",
        "warm",
        "hot",
    ]
