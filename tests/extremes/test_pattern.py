"""Patterns from 2 px to a line of 8192, too fine, too coarse, without contrast."""

from dataclasses import replace

import numpy as np

from core.pattern import decode_gray, gray_code, make_pattern
from core.scene import CheckerPattern, DotPattern, Pattern, WaveletPattern
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove

WAVELET, DOTS, BOARD = WaveletPattern(), DotPattern(), CheckerPattern()


def luminance(name: str, pattern: Pattern, rows: int, cols: int) -> Row:
    return Row("pattern", name, lambda: make_pattern(pattern, rows, cols), Within(0.0, 1.0))


def mean(name: str, pattern: Pattern, expected: Near) -> Row:
    return Row("pattern", name, lambda: float(make_pattern(pattern, 256, 256).mean()), expected)


def refused(name: str, words: str, pattern: Pattern, rows: int = 64, cols: int = 64) -> Row:
    return Row("pattern", name, lambda: make_pattern(pattern, rows, cols), Refused(words))


def gray(rows: int, cols: int) -> Row:
    """Every pixel of a panel reads its own number."""

    def error() -> float:
        row, col = decode_gray(gray_code(rows, cols).astype(float), rows, cols)
        return float(abs(row - np.arange(rows)[:, None]).max() + abs(col - np.arange(cols)[None]).max())

    return Row("pattern", f"Gray code of {cols} x {rows} px", error, Near(0.0))


ROWS = [
    *[
        luminance(f"{p.kind} of {c} x {r} px", p, r, c)
        for p in (WAVELET, DOTS, BOARD)
        for r, c in ((2, 2), (2, 8192), (64, 64))
    ],
    luminance("12 bands on 16 px", replace(WAVELET, bands=12), 16, 16),
    luminance("wavelets clipped hard", replace(WAVELET, contrast=10.0), 64, 64),
    luminance("dots larger than the wall", replace(DOTS, diameter_px=100.0), 16, 16),
    mean("wavelets without contrast", replace(WAVELET, contrast=0.0), Near(0.5)),
    mean("mean of wavelets", WAVELET, Near(0.5, abs=0.01)),
    mean("no dots", replace(DOTS, coverage=0.0), Near(1.0)),
    # 99 % of the wall in ink; the number of dots scatters by 1 / sqrt(n).
    mean("nearly all ink", replace(DOTS, coverage=0.99), Near(0.01, abs=0.01)),
    mean("board with one square", replace(BOARD, square_px=1e6), Near(0.0)),
    mean("board of single pixels", replace(BOARD, square_px=1.0), Near(0.5)),
    refused("one pattern pixel", "at least 2 x 2", WAVELET, 1, 1),
    refused("100 m of wall at 1 mm", "pixel_m", WAVELET, 100_000, 100_000),
    refused("finer than two pixels", "finest_px", replace(WAVELET, finest_px=1.0)),
    refused("finest period NaN", "finest_px", replace(WAVELET, finest_px=float("nan"))),
    refused("no band", "bands", replace(WAVELET, bands=0)),
    refused("60 bands", "bands", replace(WAVELET, bands=60)),
    refused("negative contrast", "contrast", replace(WAVELET, contrast=-0.2)),
    refused("dots of half a pixel", "diameter_px", replace(DOTS, diameter_px=0.5)),
    refused("dots of a million pixels", "diameter_px", replace(DOTS, diameter_px=1e6)),
    refused("all ink", "coverage", replace(DOTS, coverage=1.0)),
    refused("squares of 0 px", "square_px", replace(BOARD, square_px=0.0)),
    refused("endless squares", "square_px", replace(BOARD, square_px=float("inf"))),
    *[gray(r, c) for r, c in ((2, 2), (3, 5), (64, 1), (7, 4096))],
]


@extremes(ROWS)
def test_patterns_at_their_limits(row: Row, record_property):
    prove(row, record_property)
