"""Shifts between two images: 8 to 8192 px, one count to 65,535, dark, saturated, constant."""

import numpy as np
from scipy import ndimage

from app.reconstruct.measure import frame_variance
from app.report.displacement import shift_field
from core.displacement import measure_shift, standard_deviation_px
from core.drift import STILL, fit_motion, move_image
from core.geometry import looking_along_y
from core.motion import motion_basis
from core.problem import ShiftMeasurement
from core.scene import CameraNoise
from drivers.quick_look import quick_look
from tests.extremes.row import Named, Near, Refused, Row, Within, extremes, prove

STAGE = "shift"
# About a hundred 10-bit frames, as parts of full scale.
VARIANCE = 1e-6
LENS = looking_along_y(position_m=(0.0, 0.0, 0.0), width_px=100, height_px=100, focal_px=1e4)


def waves(rows: int, cols: int, shift_px: float = 0.0, dtype: type = np.float32) -> np.ndarray:
    """A texture with periods of 6.3 to 17 px, moved along columns exactly."""
    y, x = np.mgrid[0:rows, 0:cols].astype(float)
    x = x - shift_px
    bright = np.sin(x) + np.sin(0.37 * x + 0.71 * y) + np.sin(0.9 * y + 1.0) + np.sin(0.61 * x - 0.43 * y)
    return (0.5 + 0.1 * bright).astype(dtype)


def moved(reference: np.ndarray, flow: np.ndarray, window_px: int = 16) -> float:
    """Information-weighted mean shift along columns of the inner windows."""
    found = measure_shift(reference, flow, VARIANCE, window_px)
    weight = found.information_per_px2[:, 0, 0]
    inner = np.all(
        (found.centres_px > 20) & (found.centres_px < np.array(reference.shape[::-1]) - 20), axis=1
    )
    keep = inner if inner.any() else np.ones_like(inner)
    return float((weight * found.displacement_px[:, 0])[keep].sum() / weight[keep].sum())


def recovered(shift_px: float, dtype: type = np.float32) -> Row:
    """Linear in the shift: an error of the second order in shift over period."""
    name = f"shift of {shift_px:g} px, {np.dtype(dtype).name}"
    run = lambda: moved(waves(96, 96, 0.0, dtype), waves(96, 96, shift_px, dtype))  # noqa: E731
    # Float32 grey values have steps of 6e-8, over some 1e4 pixels with slopes of 0.1: below 1e-7 px.
    return Row(STAGE, name, run, Near(shift_px, rel=0.02, abs=1e-12 if dtype is np.float64 else 3e-7))


def digitised(counts: int) -> Row:
    """A shift of 0.1 px through a camera with so many grey levels."""

    def run() -> float:
        pair = [np.rint(waves(96, 96, s) * counts) / counts for s in (0.0, 0.1)]
        return moved(pair[0].astype(np.float32), pair[1].astype(np.float32))

    # Nothing dithers the grey levels here: a shift that moves few pixels over a step is seen too small.
    return Row(STAGE, f"0.1 px in {counts} counts", run, Near(0.1, rel=0.02, abs=0.15 / counts))


def uninformed(name: str, reference: np.ndarray, flow: np.ndarray) -> Row:
    """No texture: a shift of 0 that says that it knows nothing."""

    def run() -> np.ndarray:
        found = measure_shift(reference, flow, VARIANCE, 8)
        return np.concatenate([found.displacement_px.ravel(), 1 / standard_deviation_px(found).ravel()])

    return Row(STAGE, name, run, Near(0.0, abs=2e-3))


def flat(value: float, rows: int = 32, cols: int = 32) -> np.ndarray:
    return np.full((rows, cols), value, np.float32)


def refused(name: str, words: str, *arguments: object) -> Row:
    return Row(STAGE, name, lambda: measure_shift(*arguments).displacement_px, Refused(words))  # type: ignore[arg-type]


def motion(windows: int, static: int) -> Row:
    """A common move of (0.1, -0.2) px from few windows, or from none at all."""

    def run() -> np.ndarray:
        centres = np.random.default_rng(0).uniform(0, 100, (windows, 2))
        given = np.broadcast_to([0.1, -0.2], (windows, 2)).copy()
        measured = ShiftMeasurement(
            centres, given, np.broadcast_to(np.eye(2) * 1e6, (windows, 2, 2)).copy(), 8
        )
        motion_px, _ = fit_motion(measured, np.arange(windows) < static, LENS, STILL, 10.0)
        return motion_basis(centres[: max(static, 1)], LENS) @ motion_px

    expected = np.array([0.1, -0.2]) if static else np.zeros(2)
    return Row(STAGE, f"drift from {static} of {windows} windows", run, Near(expected[None], abs=1e-5))


def looked(name: str, image: np.ndarray) -> Row:
    def run() -> float:
        look = quick_look(image, image)
        return max(look.largest_px, abs(look.drift_px[0]), look.drift_spread_px)

    return Row(STAGE, f"quick look at {name}", run, Near(0.0, abs=1e-3))


def dense(name: str, image: np.ndarray) -> Row:
    """The picture against itself: no shift (Farneback: 0.02 px at the edge), and a positive deviation."""

    def run() -> np.ndarray:
        field = shift_field(image, image)
        return np.concatenate([field.displacement_px.ravel(), (field.std_px <= 0).ravel()])

    even = name in ("darkness", "saturation")
    return Row(
        STAGE, f"dense shift of {name}", run, Refused("shows no pattern") if even else Near(0.0, abs=0.05)
    )


def noise(name: str, image: np.ndarray, model: CameraNoise) -> Row:
    return Row(
        STAGE, f"variance of {name}", lambda: np.log10(frame_variance(image, model)), Within(-12.0, 1.0)
    )


def precision() -> float:
    narrow, wide = (moved(waves(64, 64, 0.0, t), waves(64, 64, 0.05, t)) for t in (np.float32, np.float64))
    return narrow - wide


def blank_row() -> str:
    """A dead row spoils its own windows only, and finitely."""
    reference, flow = waves(96, 96), waves(96, 96, 0.05)
    reference[40], flow[40] = 0.0, 1.0
    found = measure_shift(reference, flow, VARIANCE, 16).displacement_px.reshape(6, 6, 2)
    good = np.isfinite(found).all() and np.abs(found[[0, 4], 1:5, 0] - 0.05).max() < 0.005
    return "contained" if good else "spread"


PAIR = waves(32, 32), waves(32, 32, 0.05)
NAN = np.where(np.eye(32, dtype=bool), np.nan, PAIR[0]).astype(np.float32)

ROWS = [
    *[recovered(s) for s in (1e-4, 1e-3, 1e-2, 0.1, -0.1)],
    *[recovered(s, np.float64) for s in (1e-8, 1e-5, 1e-2)],
    Row(STAGE, "float32 against float64 at 0.05 px", precision, Near(0.0, abs=3e-7)),
    *[digitised(c) for c in (3, 15, 255, 4095, 65_535)],
    uninformed("two dark images", flat(0.0), flat(0.0)),
    uninformed("two saturated images", flat(1.0), flat(1.0)),
    uninformed("two grey images", flat(0.5), flat(0.5)),
    uninformed("dark, then saturated", flat(0.0), flat(1.0)),
    uninformed("8 x 8 grey pixels", flat(0.5, 8, 8), flat(0.5, 8, 8)),
    Row(STAGE, "8 x 8 px", lambda: moved(waves(8, 8), waves(8, 8), 8), Near(0.0, abs=1e-9)),
    Row(STAGE, "8192 x 64 px", lambda: moved(waves(64, 8192), waves(64, 8192, 0.05)), Near(0.05, rel=0.02)),
    Row(STAGE, "a lamp 20 % dimmer", lambda: moved(waves(96, 96), np.float32(0.8) * waves(96, 96, 0.05)),
        Near(0.05, rel=0.03)),
    Row(STAGE, "a dead row", blank_row, Named("contained")),
    Row(STAGE, "1e-30 of noise variance",
        lambda: measure_shift(*PAIR, 1e-30, 16).displacement_px[:, 0], Near(0.05, rel=0.5)),
    Row(STAGE, "1e30 of noise variance",
        lambda: measure_shift(*PAIR, 1e30, 16).displacement_px[:, 0], Near(0.0, abs=1e-6)),
    refused("no noise at all", "variance", *PAIR, 0.0, 16),
    refused("noise NaN", "variance", *PAIR, float("nan"), 16),
    refused("window larger than the image", "smaller than one window", *PAIR, VARIANCE, 64),
    refused("window of 0 px", "window_px", *PAIR, VARIANCE, 0),
    refused("window of 1 px", "window_px", *PAIR, VARIANCE, 1),
    refused("images of two sizes", "equal sizes", PAIR[0], waves(16, 16), VARIANCE, 8),
    refused("a pixel that is NaN", "not finite", NAN, PAIR[1], VARIANCE, 8),
    motion(40, 40), motion(40, 2), motion(1, 1), motion(4, 0),
    Row(STAGE, "moved by nothing", lambda: move_image(waves(32, 32), STILL, LENS) - waves(32, 32),
        Near(0.0, abs=1e-6)),
    Row(STAGE, "moved out of the picture",
        lambda: move_image(waves(32, 32), np.array([1e4, 0.0, 0.0, 0.0, 0.0, 0.0]), LENS), Within(-0.5, 1.5)),
    *[looked(n, i) for n, i in (
        ("darkness", flat(0.0, 128, 128)), ("saturation", flat(1.0, 128, 128)), ("grey", flat(0.5, 128, 128)),
        ("waves", waves(192, 192)), ("8 x 8 px", waves(8, 8)),
    )],
    *[dense(n, i) for n, i in (("darkness", flat(0.0)), ("saturation", flat(1.0)), ("waves", waves(48, 48)))],
    noise("darkness, 12 bits", flat(0.0), CameraNoise()),
    noise("saturation, 16 bits", flat(1.0), CameraNoise(bits=16)),
    noise("1 bit", flat(0.5), CameraNoise(bits=1, dark_counts=0.0)),
    noise("one electron", flat(1.0), CameraNoise(full_well_e=1.0)),
    noise("below dark", ndimage.shift(flat(0.0), 1), CameraNoise(dark_counts=3000.0)),
]  # fmt: skip


@extremes(ROWS)
def test_shifts_at_their_limits(row: Row, record_property):
    prove(row, record_property)
