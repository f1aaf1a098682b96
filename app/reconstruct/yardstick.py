"""What in the picture may tell how the camera moved: marks that somebody drew, or the border beyond the wall.

A part that is still moves like a rigid picture, and all still parts move alike. One that moves otherwise has the
room's air before it, or moved itself: it is refused, by name.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Float32

from core.displacement import ShiftOfPair
from core.drift import Similarity, fit_similarity, move_image
from core.problem import ShiftMeasurement

Mask = Bool[np.ndarray, " windows"]

# A drift below this moves no window by more than the noise of a hundred frames.
_SMALL_DRIFT_PX = 2e-3
_PASSES = 3
# What a rigid motion leaves of still parts has a mean square of 1 over its noise, which the noise model may have
# wrong by this factor; chance adds at most so many standard deviations (one still border in 30,000 is refused).
_NOISE_FACTOR, _SIGMAS = 1.3, 4.0
# Fewer windows than this say nothing of a rigid motion: in all, and in one of several parts.
_LEAST_WINDOWS, _LEAST_IN_PART = 12, 4
# A window that knows its shift no better than to a pixel shows nothing: a bare wall is of such windows.
_SEEN_PER_PX2 = 1.0


@dataclass(frozen=True)
class Exposures:
    """The two pictures of a view, the variance of their difference, and the windows' width."""

    before: Float32[np.ndarray, "rows cols"]
    after: Float32[np.ndarray, "rows cols"]
    variance: Float32[np.ndarray, "rows cols"]
    window_px: int

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.before.shape[1], self.before.shape[0]

    @cached_property
    def as_they_are(self) -> ShiftOfPair:
        """Both pictures, before any motion is taken out."""
        return ShiftOfPair(self.before, self.after, self.variance, self.window_px)

    def moved(self, drift: Similarity) -> ShiftOfPair:
        """Both pictures, with the first as it looks after a motion of the camera."""
        return ShiftOfPair(move_image(self.before, drift), self.after, self.variance, self.window_px)


@dataclass(frozen=True)
class Yardstick:
    """A part of the picture that may be still: what it is called, and the windows that lie wholly in it."""

    name: str
    windows: Mask


@dataclass(frozen=True)
class Rigid:
    """The motion of the camera that some windows tell, its deviation, and what it leaves of them.

    `shift` is that of all windows without the motion. The columns of `root_px` are motions of one standard deviation
    in px at the picture's edge, infinite where nothing is known; `unlike` is the mean square, over its noise, of what
    the motion leaves.
    """

    shift: ShiftMeasurement
    motion: Similarity
    root_px: Float[np.ndarray, "4 4"]
    unlike: float
    windows: int

    @property
    def is_rigid(self) -> bool:
        """Whether what the motion leaves is noise."""
        return is_noise(self.unlike, self.windows)

    @property
    def std_px(self) -> float:
        """The largest motion of one standard deviation."""
        return float(np.linalg.norm(self.root_px, axis=0).max())


def read_motion(exposures: Exposures, windows: Mask) -> Rigid:
    """The motion of the camera as these windows tell it, if they are still."""
    shape, first = exposures.before.shape, exposures.as_they_are.measured(follow=False)
    if good_windows(first, windows).sum() < _LEAST_IN_PART:
        return Rigid(first, Similarity(), np.full((4, 4), np.inf), 0.0, 0)
    shift, drift = aligned(exposures, windows)
    good = good_windows(shift, windows)
    rest, covariance = fit_similarity(shift, good, shape)
    left_px = shift.displacement_px - rest.displacement_px(shift.centres_px, shape)
    unlike, root_px = _mean_square(shift, left_px, good), _root_px(covariance, exposures.size_px)
    return Rigid(replace(shift, displacement_px=left_px), rest.after(drift), root_px, unlike, int(good.sum()))


def trusted(exposures: Exposures, parts: Sequence[Yardstick]) -> "Trusted":
    """The parts that move like one rigid picture, what they tell, and why each of the others is refused."""
    kept, refused = [], []
    shift = aligned(exposures, _together(parts))[0]
    for part in parts:
        why = _why_not(shift, part, exposures.before.shape)
        kept += [part] if why is None else []
        refused += [] if why is None else [f"The {part.name} cannot tell the camera's motion: {why}."]
    while kept:
        whole = read_motion(exposures, _together(kept))
        if whole.is_rigid or len(kept) == 1:
            return Trusted(tuple(one.name for one in kept), whole, tuple(refused))
        odd = _odd_ones(exposures, kept)
        refused.append(_unlike_others([one.name for one in odd], whole.unlike))
        kept = [one for one in kept if one not in odd]
    return Trusted((), None, tuple(refused))


@dataclass(frozen=True)
class Trusted:
    """The names of the parts that are believed, what they tell (None where there is none), and the refusals."""

    names: tuple[str, ...]
    read: Rigid | None
    refused: tuple[str, ...]


def aligned(exposures: Exposures, yardstick: Mask) -> tuple[ShiftMeasurement, Similarity]:
    """The shifts that are left when the reference is moved as the yardstick moved, and that motion."""
    pictures, drift, shape = exposures.as_they_are, Similarity(), exposures.before.shape
    for _ in range(_PASSES if yardstick.sum() >= _LEAST_WINDOWS else 0):
        shift = pictures.measured(follow=False)
        rest, _ = fit_similarity(shift, good_windows(shift, yardstick), shape)
        if max(abs(rest.column_px), abs(rest.row_px)) < _SMALL_DRIFT_PX:
            break
        drift = rest.after(drift)
        pictures = exposures.moved(drift)
    return pictures.measured(follow=True), drift


def good_windows(shift: ShiftMeasurement, chosen: Mask) -> Mask:
    """The chosen windows that show something, and show it moved: a bare wall tells nothing, nor that it is still."""
    shows = np.trace(shift.information_per_px2, axis1=1, axis2=2) > _SEEN_PER_PX2
    return chosen & shows if shift.refused is None else chosen & shows & ~shift.refused


def is_noise(mean_square: float, windows: int) -> bool:
    """Whether what a motion leaves of so many windows is their noise."""
    return mean_square <= _NOISE_FACTOR * (1.0 + _SIGMAS / max(windows, 1) ** 0.5)


def _together(parts: Sequence[Yardstick]) -> Mask:
    return np.any([part.windows for part in parts], axis=0)


def _why_not(shift: ShiftMeasurement, part: Yardstick, shape: tuple[int, int]) -> str | None:
    """Why a part alone is no yardstick; None where nothing speaks against it."""
    good = good_windows(shift, part.windows)
    if part.windows.sum() < _LEAST_IN_PART:
        return (
            f"{int(part.windows.sum())} windows lie in it; expected {_LEAST_IN_PART} at least. Draw it larger"
        )
    if good.sum() < _LEAST_IN_PART:
        return (
            f"{int(good.sum())} of its {int(part.windows.sum())} windows show something that can be followed"
        )
    rest, _ = fit_similarity(shift, good, shape)
    unlike = _mean_square(shift, shift.displacement_px - rest.displacement_px(shift.centres_px, shape), good)
    if not is_noise(unlike, int(good.sum())):
        return f"what a rigid motion leaves of it is {unlike**0.5:.1f} times its noise, so it is not still"
    return None


def _odd_ones(exposures: Exposures, parts: list[Yardstick]) -> list[Yardstick]:
    """The part without which the others agree best; of two, both, for nobody knows which one moved."""
    if len(parts) == 2:
        return parts
    left = [[one for one in parts if one is not part] for part in parts]
    unlike = [read_motion(exposures, _together(others)).unlike for others in left]
    return [parts[int(np.argmin(unlike))]]


def _unlike_others(names: list[str], unlike: float) -> str:
    how, which = ("do not move alike", "one") if len(names) > 1 else ("do not move as the others do", "them")
    return (
        f"The {' and '.join(names)} {how}: what one rigid motion leaves is {unlike**0.5:.1f} times the noise. "
        f"The room's air is before {which}, or somebody touched {which}."
    )


def _mean_square(shift: ShiftMeasurement, left_px: Float[np.ndarray, "windows 2"], chosen: Mask) -> float:
    """Mean square over the noise of what a fitted motion leaves of some windows."""
    squares = np.einsum("wa,wab,wb->w", left_px, shift.information_per_px2, left_px)[chosen]
    return float(squares.sum() / max(2 * chosen.sum() - 4, 1))


def _root_px(covariance: Float[np.ndarray, "4 4"], size_px: tuple[int, int]) -> Float[np.ndarray, "4 4"]:
    """Motions of one standard deviation, in px at the picture's edge; without bound where nothing is known."""
    to_edge = np.array([1.0, 1.0, max(size_px) / 2, max(size_px) / 2])
    values, vectors = np.linalg.eigh(covariance * np.outer(to_edge, to_edge))
    if values[0] <= 1e-12 * values[-1]:
        return np.full((4, 4), np.inf)
    return vectors * np.sqrt(values)
