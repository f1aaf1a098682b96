"""Stripe edges: where, between two camera pixels, the Gray code goes from one projector pixel to the next.

A bit's picture minus its inverse crosses zero on the edge whatever the paint, so the crossing between
two neighbours is found to a few hundredths of a pixel, where the code alone is known to half a
projector pixel and rounds alike along a whole stripe.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Shaped

from calibration.graycode import Decoded, bits_for


@dataclass(frozen=True)
class EdgeMap:
    """Edges between each pixel and its neighbour one step along `direction` (0: right, 1: down).

    `part` is the edge's place on the way (nan: none), `code_px` the panel coordinate of the edge along
    `axis` (0: column, 1: row); `finest_frame` is the number of that code's finest pattern.
    """

    axis: int
    direction: int
    finest_frame: int
    part: Float32[np.ndarray, "rows cols"]
    code_px: Float32[np.ndarray, "rows cols"]


def stripe_edges(
    frames: Shaped[np.ndarray, "frames rows cols"], decoded: Decoded, width_px: int, height_px: int
) -> tuple[EdgeMap, ...]:
    """All edges of both codes along both directions."""
    columns = bits_for(width_px)
    maps = []
    for axis, code, first, bits in (
        (0, decoded.column_px, 0, columns),
        (1, decoded.row_px, 2 * columns, bits_for(height_px)),
    ):
        block = frames[first : first + 2 * bits]
        signed = block[::2].astype(np.float32) - block[1::2].astype(np.float32)
        finest = first + 2 * bits - 2
        maps += [_edges(axis, direction, finest, code, signed, decoded.lit) for direction in (0, 1)]
    return tuple(maps)


def edges_near(
    maps: tuple[EdgeMap, ...], centre_px: Float[np.ndarray, "2"], half_px: int
) -> tuple[Float[np.ndarray, "edges 2"], Float[np.ndarray, " edges"], Float[np.ndarray, " edges"]]:
    """Edges in a window: camera positions, panel coordinates, and the axis (0 or 1) of each."""
    x, y = np.round(centre_px).astype(int)
    top, left = max(y - half_px, 0), max(x - half_px, 0)
    places, codes, axes = [], [], []
    for found in maps:
        window = np.s_[top : y + half_px + 1, left : x + half_px + 1]
        part = found.part[window]
        row, column = np.nonzero(np.isfinite(part))
        step = part[row, column].astype(float)
        place = np.stack([column + left, row + top], axis=1).astype(float)
        place[:, found.direction] += step
        places.append(place)
        codes.append(found.code_px[window][row, column].astype(float))
        axes.append(np.full(len(step), float(found.axis)))
    return np.concatenate(places), np.concatenate(codes), np.concatenate(axes)


def _edges(
    axis: int, direction: int, finest: int, code: np.ndarray, signed: np.ndarray, lit: np.ndarray
) -> EdgeMap:
    here, there = (np.s_[:, :-1], np.s_[:, 1:]) if direction == 0 else (np.s_[:-1, :], np.s_[1:, :])
    one, two = code[here], code[there]
    rows, cols = np.nonzero((np.abs(one - two) == 1) & lit[here] & lit[there])
    upper = np.maximum(one[rows, cols], two[rows, cols])
    # Counting up to n flips the Gray bit of n's trailing zeros; the finest bit comes last.
    bit = np.log2(upper & -upper).astype(int)
    number = len(signed) - 1 - bit
    a = signed[number, rows, cols]
    b = signed[number, rows + (direction == 1), cols + (direction == 0)]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = a / (a - b)
    crossing[(a * b > 0) | (a == b)] = np.nan
    part = np.full(code.shape, np.nan, np.float32)
    code_px = np.zeros(code.shape, np.float32)
    part[rows, cols] = crossing
    code_px[rows, cols] = upper - 0.5
    return EdgeMap(axis, direction, finest, part, code_px)
