"""What is wrong with one Gray-code sequence before it is used: order, saturation, a resampling projector.

Every projector pixel is either on or off, so a pattern and its inverse add up to white and black at each
camera pixel, however blurred. Frames that are swapped, missing or moved break that everywhere; a
projector that scales or keystones shows grey pixels on the stripes' edges, whose gamma breaks it there.
"""

import numpy as np
from jaxtyping import Shaped

from calibration.graycode import Decoded
from calibration.saturation import saturated_from
from calibration.stripes import EdgeMap

# Part of the lit pixels whose pattern and inverse miss white and black by 30 %.
_SWAPPED = 0.15
# Part of white - black that the stripes' edges lack.
_GREY_EDGES = 0.012
# Fits to the edges of a native grid leave 0.02 to 0.07 projector px; rounding to another grid 0.29.
_UNEVEN_PX = 0.10


def sequence_issues(
    name: str, frames: Shaped[np.ndarray, "frames rows cols"], decoded: Decoded, full_scale: int | None
) -> tuple[str, ...]:
    """What to retake in this sequence; nothing if it is sound."""
    white, black = frames[-2].astype(np.float32), frames[-1].astype(np.float32)
    if np.mean(white) < np.mean(black):
        return (
            f"{name}: the frame before the last is darker than the last; expected white, then black. "
            "Check the order of the frames.",
        )
    if decoded.lit.mean() < 0.02:
        return (
            f"{name}: the projector lights {100 * decoded.lit.mean():.1f} % of the picture. "
            "Aim it at the board, darken the room, or lengthen the exposure.",
        )
    issues = []
    broken = _broken_pairs(frames, decoded)
    if broken:
        listed = ", ".join(f"{2 * pair} and {2 * pair + 1}" for pair in broken[:4])
        issues.append(
            f"{name}: frames {listed} are no pattern and its inverse: out of order, missing, moved or "
            "under changing light. Retake the sequence without touching anything."
        )
    top = full_scale if full_scale is not None else _type_maximum(frames)
    end = saturated_from(tuple(frames[-2:]), int(top))
    saturated = float(np.mean(white[decoded.lit] >= end)) if top else 0.0
    if saturated > 0.01:
        issues.append(
            f"{name}: {100 * saturated:.0f} % of the lit picture is saturated in white. "
            "Retake it with a shorter exposure."
        )
    if decoded.off_panel > 0.01:
        issues.append(
            f"{name}: {100 * decoded.off_panel:.0f} % of the codes lie off the panel. "
            "Check --projector-px and the order of the frames."
        )
    return tuple(issues)


def resampling_issue(
    name: str,
    frames: Shaped[np.ndarray, "frames rows cols"],
    decoded: Decoded,
    edges: tuple[EdgeMap, ...],
    fit_rms_px: float,
) -> str | None:
    """Whether the projector scales or keystones: grey stripe edges, or edges off the native grid."""
    deficit = _edge_deficit(frames, decoded, edges)
    if deficit <= _GREY_EDGES and not fit_rms_px > _UNEVEN_PX:
        return None
    return (
        f"{name}: the projector does not show its native pixels (light missing on stripe edges "
        f"{100 * deficit:.0f} %, edges uneven by {fit_rms_px:.2f} px). Turn keystone, zoom, overscan and "
        "sharpness off, send its native resolution, and retake the sequence."
    )


def _broken_pairs(frames: np.ndarray, decoded: Decoded) -> list[int]:
    """Numbers of the pairs that do not add up to white and black on most of the lit picture."""
    some = np.s_[::4, ::4]
    lit = decoded.lit[some]
    span = np.maximum(decoded.contrast[some], 1.0)
    total = frames[-2][some].astype(np.float32) + frames[-1][some].astype(np.float32)
    broken = []
    for pair in range((len(frames) - 2) // 2):
        both = frames[2 * pair][some].astype(np.float32) + frames[2 * pair + 1][some].astype(np.float32)
        if np.mean((np.abs(both - total) > 0.3 * span)[lit]) > _SWAPPED:
            broken.append(pair)
    return broken


def _edge_deficit(frames: np.ndarray, decoded: Decoded, edges: tuple[EdgeMap, ...]) -> float:
    """Light missing from pattern + inverse of the finest bit on its edges, against elsewhere."""
    total = frames[-2].astype(np.float32) + frames[-1].astype(np.float32)
    span = np.maximum(decoded.contrast, 1.0)
    deficits = []
    for axis in (0, 1):
        of_axis = [e for e in edges if e.axis == axis]
        finest = of_axis[0].finest_frame
        both = frames[finest].astype(np.float32) + frames[finest + 1].astype(np.float32)
        missing = (total - both) / span
        # The finest bit changes at every odd count.
        changes = [np.isfinite(e.part) & (np.rint(e.code_px + 0.5) % 2 == 1) for e in of_axis]
        on_edge = np.any(changes, axis=0) & decoded.lit
        away = decoded.lit & ~on_edge
        if min(on_edge.sum(), away.sum()) > 500:
            deficits.append(float(np.mean(missing[on_edge]) - np.mean(missing[away])))
    return max(deficits, default=0.0)


def _type_maximum(frames: np.ndarray) -> float:
    return float(np.iinfo(frames.dtype).max) if np.issubdtype(frames.dtype, np.integer) else 0.0
