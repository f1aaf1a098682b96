"""What a figure means: its category in ISO 7730, or how it compares with a room that is mixed at once.

An interval that reaches over several categories names the first and the last of them: nothing is claimed that is not
known. What has no such yardstick has no words.
"""

from collections.abc import Mapping

from app.report.indoor import Quantity

# ISO 7730:2005, table A.1 and A.3: what lies below belongs to category A, B or C. PMV by its size.
_CATEGORIES: Mapping[str, tuple[float, float, float]] = {
    "head_to_ankle": (2.0, 3.0, 4.0),
    "head_to_ankle_p95": (2.0, 3.0, 4.0),
    "draught_rate_mean": (10.0, 20.0, 30.0),
    "draught_rate_p95": (10.0, 20.0, 30.0),
    "ppd": (6.0, 10.0, 15.0),
    "pmv": (0.2, 0.5, 0.7),
}
DRAUGHT_LIMITS = _CATEGORIES["draught_rate_p95"]
PMV_LIMITS = _CATEGORIES["pmv"]
# What a room that is mixed at once has.
MIXED: Mapping[str, float] = {"efficiency": 50.0, "zone_index": 1.0, "source_effectiveness": 1.0}
# Of the places where people are, so many in a hundred are to be comfortable (ASHRAE 113).
_ADPI_PERCENT = 80.0
_WARMTH = ((0.2, "neither warm nor cool"), (0.5, "hardly {}"), (1.5, "a little {}"), (2.5, "{}"))


def meaning(quantity: Quantity) -> str:
    """Words beside a figure; none where there is no yardstick."""
    ends = _ends(quantity)
    if quantity.key == "pmv":
        return f"{warmth(quantity.value)}; {category(quantity)}"
    if quantity.key in _CATEGORIES:
        return category(quantity)
    if quantity.key in MIXED:
        return beside(
            *ends, MIXED[quantity.key], "better than mixed", "worse than mixed", "not told from mixed"
        )
    if quantity.key == "adpi":
        return beside(
            *ends,
            _ADPI_PERCENT,
            "comfortable",
            f"below the {_ADPI_PERCENT:g} % that are wanted",
            "not told from what is wanted",
        )
    return ""


def category(quantity: Quantity) -> str:
    """Category A, B or C, or none of them; from the first to the last that the interval reaches over."""
    low, high = _ends(quantity)
    if quantity.key == "pmv":
        low, high = (0.0 if low < 0.0 < high else min(abs(low), abs(high))), max(abs(low), abs(high))
    first, last = (_letter(end, _CATEGORIES[quantity.key]) for end in (low, high))
    if first == last:
        return f"category {first}" if first else "worse than category C"
    return f"category {first} to {last}" if last else f"category {first} or worse"


def warmth(vote: float) -> str:
    """What a predicted mean vote says, in words."""
    word = "warm" if vote > 0 else "cool"
    return next(
        (words.format(word) for limit, words in _WARMTH if abs(vote) < limit), "hot" if vote > 0 else "cold"
    )


def beside(low: float, high: float, limit: float, above: str, below: str, open_: str) -> str:
    """Which side of a limit the whole interval lies on, or that it is not known."""
    if low > limit:
        return above
    return below if high < limit else open_


def _ends(quantity: Quantity) -> tuple[float, float]:
    low, high = (quantity.value if end is None else end for end in (quantity.low, quantity.high))
    return low, high


def _letter(value: float, limits: tuple[float, float, float]) -> str:
    return next((letter for letter, limit in zip("ABC", limits, strict=True) if value < limit), "")
