"""What in the picture may tell how the camera moved: marks that somebody drew, or the border beyond the wall.

A part that is still moves like a rigid picture, and all still parts move alike. One that moves otherwise has the
room's air before it, or moved itself: it is refused, by name.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import special

from core.displacement import ShiftOfPair
from core.drift import STILL, Motion, fit_motion, move_image
from core.geometry import Optics
from core.motion import MOTIONS, motion_basis
from core.problem import ShiftMeasurement

Mask = Bool[np.ndarray, " windows"]

# A drift below this moves no window by more than the noise of a hundred frames.
_SMALL_DRIFT_PX = 2e-3
_PASSES = 3
# What a rigid motion leaves of still parts has a mean square of 1 over its noise, which the noise model may have
# wrong by this factor; chance adds at most so many standard deviations (one still border in 30,000 is refused).
_NOISE_FACTOR, _SIGMAS = 1.3, 4.0
# What air does to a border is smooth: a polynomial of this degree along both. One still border in so many is said to
# have air before it.
_SMOOTH, _LEAST_CHANCE = 4, 1e-4
# Of a border a window is odd that leaves more than so many times what the median one does: of noise one in 2**20.
_ODD = 20.0
# So much of a motion of the whole picture a measured shift may be wrong by, alike in neighbours: 1.1e-3 by
# `tests.benchmarks.shift`, 1.2e-3 of a sharp print that moved by 0.3 px.
_BIAS = 2e-3
# Fewer windows than this say nothing of a rigid motion: in all, and in one of several parts.
_LEAST_WINDOWS, _LEAST_IN_PART = 12, 4
# A window that knows its shift no better than to a pixel shows nothing: a bare wall is of such windows.
_SEEN_PER_PX2 = 1.0


@dataclass(frozen=True)
class Exposures:
    """The two pictures of a view, the variance of their difference, the windows' width, and the camera's lens."""

    before: Float32[np.ndarray, "rows cols"]
    after: Float32[np.ndarray, "rows cols"]
    variance: Float32[np.ndarray, "rows cols"]
    window_px: int
    optics: Optics

    @cached_property
    def as_they_are(self) -> ShiftOfPair:
        """Both pictures, before any motion is taken out."""
        return ShiftOfPair(self.before, self.after, self.variance, self.window_px)

    def moved(self, drift_px: Motion) -> ShiftOfPair:
        """Both pictures, with the first as it looks after a motion of the camera."""
        return ShiftOfPair(
            move_image(self.before, drift_px, self.optics), self.after, self.variance, self.window_px
        )


@dataclass(frozen=True)
class Yardstick:
    """A part of the picture that may be still: what it is called, and the windows that lie wholly in it."""

    name: str
    windows: Mask


@dataclass(frozen=True)
class MotionPrior:
    """What is known of the camera's six motions before a pair of pictures is looked at: mean, and one deviation [px].

    `source` says where it comes from.
    """

    mean_px: Motion
    std_px: float
    source: str


@dataclass(frozen=True)
class Rigid:
    """The motion of the camera that some windows and its prior tell, and what it leaves of the windows.

    `shift` is that of all windows without the motion, `asked` those that told it. The columns of `root_px` are what
    stays unknown of it, in motions of one standard deviation; `unlike` is the mean square, over its noise, of what
    the motion leaves of the windows that were asked. `alike_px` is how large (rms) a part of that is alike in
    neighbours, and never less than noise may hide; `by_chance` is how likely noise alone would leave so much of it.
    `moved_px` is how far the windows moved along an axis (rms), and `odd` the share of the windows that moved unlike
    the others and do not tell the motion.
    """

    shift: ShiftMeasurement
    asked: Mask
    motion_px: Motion
    root_px: Float[np.ndarray, "6 6"]
    unlike: float
    alike_px: float
    by_chance: float
    moved_px: float
    odd: float = 0.0

    @property
    def is_rigid(self) -> bool:
        """Whether what the motion leaves is noise: no more than that, and no more alike in neighbours than by chance.

        What is so small beside the motion that a measured motion may be wrong by as much counts as noise.
        """
        noise = is_noise(self.unlike, int(self.asked.sum()))
        return noise and (self.by_chance > _LEAST_CHANCE or self.alike_px < _BIAS * self.moved_px)

    @property
    def what_is_left(self) -> str:
        """What the motion leaves, in words."""
        if is_noise(self.unlike, int(self.asked.sum())):
            alike_px = f"{self.alike_px:.2g} px"
            return f"what a rigid motion leaves moves neighbouring windows alike by {alike_px}, as air does"
        return f"what a rigid motion leaves is {self.unlike**0.5:.1f} times its noise"


def read_motion(exposures: Exposures, windows: Mask, prior: MotionPrior) -> Rigid | None:
    """The motion of the camera as these windows tell it, if they are still; None where too few show something."""
    first = exposures.as_they_are.measured(follow=False)
    if good_windows(first, windows).sum() < _LEAST_IN_PART:
        return None
    shift, drift_px = aligned(exposures, windows, prior)
    return _fitted(shift, windows, exposures.optics, prior, drift_px)


def read_border(exposures: Exposures, border: Mask, prior: MotionPrior) -> Rigid | None:
    """The motion of the camera as a border tells it, if most of it is still; None where too little shows something.

    Of a thing that stands before a part of it, or moved there, a few windows move unlike all others. Those do not
    tell the motion. In what it leaves each counts as one that is just not odd, so many of them have it refused.
    """
    read, alike, typical = read_motion(exposures, border, prior), border, 0.0
    for _ in range(_PASSES):
        if read is None:
            return None
        misfit = _squares(read.shift) / 2
        typical = max(float(np.median(misfit[good_windows(read.shift, alike)])), np.log(2.0))
        before, alike = alike, border & (misfit <= _ODD * typical)
        if np.array_equal(before, alike):
            break
        read = read_motion(exposures, alike, prior)
    if read is None:
        return None
    odd = float(1.0 - read.asked.sum() / good_windows(read.shift, border).sum())
    return replace(read, odd=odd, unlike=(1.0 - odd) * read.unlike + odd * _ODD * typical)


def _fitted(
    shift: ShiftMeasurement, windows: Mask, optics: Optics, prior: MotionPrior, taken_px: Motion
) -> Rigid:
    """What some windows tell of the rest of a motion, when so much of it is taken out of the shifts."""
    good = good_windows(shift, windows)
    rest_px, covariance = fit_motion(shift, good, optics, prior.mean_px - taken_px, prior.std_px)
    basis = motion_basis(shift.centres_px, optics)
    left_px = shift.displacement_px - basis @ rest_px
    left = replace(shift, displacement_px=left_px)
    fitted = MOTIONS - np.trace(covariance) / prior.std_px**2
    unlike = float(_squares(left)[good].sum() / max(2 * good.sum() - fitted, 1.0))
    values, vectors = np.linalg.eigh(covariance)
    return Rigid(
        left,
        good,
        taken_px + rest_px,
        max(1.0, unlike) ** 0.5 * vectors * np.sqrt(np.maximum(values, 0.0)),
        unlike,
        *_alike(shift, left_px, good, optics),
        float(np.sqrt(np.mean((basis[good] @ (taken_px + rest_px)) ** 2))),
    )


def _squares(shift: ShiftMeasurement) -> Float[np.ndarray, " windows"]:
    """Of each window its shift's square over its noise: chi-squared of two numbers where it did not move."""
    shifts = shift.displacement_px
    return np.einsum("wa,wab,wb->w", shifts, shift.information_per_px2, shifts)


def believed(read: Rigid, prior: MotionPrior, optics: Optics) -> Rigid:
    """What a border tells if some of its reading may be air that the noise hides.

    Air moves neighbours alike, and in part as each motion of the camera would: by as much, as far as anybody knows,
    as it moves them otherwise (`alike_px`). A motion that moves the border less may so be wrong by more. That
    variance is added to each, and each goes back towards the prior as far as it is less certain now.
    """
    vectors, size_px, _ = np.linalg.svd(read.root_px)
    told = np.maximum(size_px**-2 - prior.std_px**-2, 0.0)
    border = motion_basis(read.shift.centres_px[read.asked], optics) @ vectors
    air_px = read.alike_px / np.sqrt(np.mean(border**2, axis=(0, 1)))
    less = told / (1.0 + told * air_px**2)
    variance = 1.0 / (less + prior.std_px**-2)
    kept = np.divide(variance * less, size_px**2 * told, out=np.zeros(MOTIONS), where=told > 0)
    back_px = (vectors * (1.0 - kept)) @ vectors.T @ (read.motion_px - prior.mean_px)
    shift = read.shift
    moved_px = shift.displacement_px + motion_basis(shift.centres_px, optics) @ back_px
    return replace(
        read,
        shift=replace(shift, displacement_px=moved_px),
        motion_px=read.motion_px - back_px,
        root_px=vectors * np.sqrt(variance),
    )


def _alike(
    shift: ShiftMeasurement, left_px: Float[np.ndarray, "windows 2"], good: Mask, optics: Optics
) -> tuple[float, float]:
    """How large the smooth part of some windows' shifts is [px], and how likely white noise would leave so much.

    Air moves neighbours alike, noise each by itself. How large the noise is does not matter: an F test.
    """
    root = np.linalg.cholesky(shift.information_per_px2[good]).transpose(0, 2, 1)
    left = np.einsum("wab,wb->wa", root, left_px[good]).ravel()
    rigid = motion_basis(shift.centres_px[good], optics)
    free, powers = left.size - MOTIONS, _SMOOTH
    while powers and 2 * _smooth_count(powers) > free // 2:
        powers -= 1
    if powers < 2:
        return 0.0, 1.0
    x, y = (2.0 * shift.centres_px[good] / (optics.width_px, optics.height_px) - 1.0).T
    terms = np.stack([x**i * y**j for i in range(powers + 1) for j in range(powers + 1 - i)], axis=-1)
    smooth = np.einsum("wt,ab->watb", terms, np.eye(2)).reshape(len(terms), 2, -1)
    weighted = [np.einsum("wab,wbp->wap", root, one).reshape(left.size, -1) for one in (rigid, smooth)]
    with_smooth, rank = _explained(left, np.concatenate(weighted, axis=1))
    by_motion, few = _explained(left, weighted[0])
    rest, count, free = float(left @ left) - with_smooth, rank - few, left.size - rank
    if count < 1 or free < 1 or rest <= 0.0:
        return 0.0, 1.0
    noise, found = rest / free, with_smooth - by_motion
    beyond = max(found - count * noise, (2.0 * count) ** 0.5 * noise)
    per_px2 = np.trace(shift.information_per_px2[good], axis1=1, axis2=2).sum()
    return float(np.sqrt(beyond / per_px2)), float(special.fdtrc(count, free, found / count / noise))


def _explained(
    left: Float[np.ndarray, " numbers"], basis: Float[np.ndarray, "numbers terms"]
) -> tuple[float, int]:
    """Sum of squares that a basis explains, and its rank."""
    found, _, rank, _ = np.linalg.lstsq(basis, left, rcond=1e-6)
    return float(left @ basis @ found), int(rank)


def _smooth_count(powers: int) -> int:
    return (powers + 1) * (powers + 2) // 2


def trusted(exposures: Exposures, parts: Sequence[Yardstick], prior: MotionPrior) -> "Trusted":
    """The parts that move like one rigid picture, what they tell, and why each of the others is refused."""
    kept, refused = [], []
    shift, drift_px = aligned(exposures, _together(parts), prior)
    for part in parts:
        why = _why_not(part, good_windows(shift, part.windows)) or _not_still(
            _fitted(shift, part.windows, exposures.optics, prior, drift_px)
        )
        kept += [part] if why is None else []
        refused += [] if why is None else [f"The {part.name} cannot tell the camera's motion: {why}."]
    while kept:
        whole = read_motion(exposures, _together(kept), prior)
        if whole is None or whole.is_rigid or len(kept) == 1:
            return Trusted(tuple(one.name for one in kept), whole, tuple(refused))
        odd = _odd_ones(exposures, kept, prior)
        refused.append(_unlike_others([one.name for one in odd], whole))
        kept = [one for one in kept if one not in odd]
    return Trusted((), None, tuple(refused))


@dataclass(frozen=True)
class Trusted:
    """The names of the parts that are believed, what they tell (None where there is none), and the refusals."""

    names: tuple[str, ...]
    read: Rigid | None
    refused: tuple[str, ...]


def aligned(exposures: Exposures, yardstick: Mask, prior: MotionPrior) -> tuple[ShiftMeasurement, Motion]:
    """The shifts that are left when the reference is moved as the yardstick moved, and that motion."""
    pictures, drift_px = exposures.as_they_are, STILL
    for _ in range(_PASSES if yardstick.sum() >= _LEAST_WINDOWS else 0):
        shift = pictures.measured(follow=False)
        good = good_windows(shift, yardstick)
        rest_px, _ = fit_motion(shift, good, exposures.optics, prior.mean_px - drift_px, prior.std_px)
        if np.abs(motion_basis(shift.centres_px, exposures.optics) @ rest_px).max() < _SMALL_DRIFT_PX:
            break
        drift_px = drift_px + rest_px
        pictures = exposures.moved(drift_px)
    return pictures.measured(follow=True), drift_px


def good_windows(shift: ShiftMeasurement, chosen: Mask) -> Mask:
    """The chosen windows that show something, and show it moved: a bare wall tells nothing, nor that it is still."""
    shows = np.trace(shift.information_per_px2, axis1=1, axis2=2) > _SEEN_PER_PX2
    return chosen & shows if shift.refused is None else chosen & shows & ~shift.refused


def is_noise(mean_square: float, windows: int) -> bool:
    """Whether what a motion leaves of so many windows is their noise."""
    return mean_square <= _NOISE_FACTOR * (1.0 + _SIGMAS / max(windows, 1) ** 0.5)


def _together(parts: Sequence[Yardstick]) -> Mask:
    return np.any([part.windows for part in parts], axis=0)


def _why_not(part: Yardstick, good: Mask) -> str | None:
    """Why a part's windows tell nothing; None where enough of them are good."""
    windows = int(part.windows.sum())
    if windows < _LEAST_IN_PART:
        return f"{windows} windows lie in it; expected {_LEAST_IN_PART} at least. Draw it larger"
    if good.sum() < _LEAST_IN_PART:
        return f"{int(good.sum())} of its {windows} windows show something that can be followed"
    return None


def _not_still(read: Rigid) -> str | None:
    if read.is_rigid:
        return None
    return f"{read.what_is_left}, so it is not still"


def _odd_ones(exposures: Exposures, parts: list[Yardstick], prior: MotionPrior) -> list[Yardstick]:
    """The part without which the others agree best; of two, both, for nobody knows which one moved."""
    if len(parts) == 2:
        return parts
    left = [read_motion(exposures, _together([o for o in parts if o is not part]), prior) for part in parts]
    unlike = [np.inf if read is None else read.unlike for read in left]
    return [parts[int(np.argmin(unlike))]]


def _unlike_others(names: list[str], whole: Rigid) -> str:
    how, which = ("do not move alike", "one") if len(names) > 1 else ("do not move as the others do", "them")
    return (
        f"The {' and '.join(names)} {how}: {whole.what_is_left}. "
        f"The room's air is before {which}, or somebody touched {which}."
    )
