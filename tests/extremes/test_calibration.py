"""Calibration from pictures that show nothing, boards in millimetres, devices in one place."""

import cv2
import numpy as np

from calibration import model
from calibration.adjustment import Device
from calibration.board import Chessboard
from calibration.drift import measure_drift
from calibration.graycode import decode, patterns
from calibration.record import Record, SeenBoard
from calibration.registration import border_mask, register
from calibration.stripes import stripe_edges
from calibration.wall import Correspondences, correspondences, fit_plane, triangulate
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove
from tests.extremes.test_shift import flat, waves

STAGE = "calibration"
BORDER = border_mask((96, 128), 24)
WAVES = waves(96, 128)


def registered(
    name: str, reference: np.ndarray, moved: np.ndarray, expected, mask: np.ndarray = BORDER
) -> Row:
    """Shift along columns, and its advice is a sentence or none."""
    run = lambda: measure_drift(reference, moved, mask).total.motion.shift_px[0]  # noqa: E731
    return Row(STAGE, f"drift: {name}", run, expected)


def decoded(name: str, change, expected, size_px: tuple[int, int] = (64, 48)) -> Row:
    """The share of pixels that a panel lights and that read their own column."""

    def run() -> float:
        frames = change(patterns(*size_px))
        found = decode(frames, *size_px)
        right = found.column_px == np.arange(size_px[0])[None]
        return float(np.mean(found.lit & right))

    return Row(STAGE, f"Gray code: {name}", run, expected)


def wall(name: str, change, expected) -> Row:
    def run() -> float:
        frames = change(patterns(64, 48))
        found = decode(frames, 64, 48)
        return float(len(correspondences(found, stripe_edges(frames, found, 64, 48), 4).camera_px))

    return Row(STAGE, f"wall: {name}", run, expected)


def plane(name: str, points_m: np.ndarray, expected) -> Row:
    return Row(STAGE, f"plane: {name}", lambda: fit_plane(points_m).offset_m, expected)


def device(x_m: float) -> Device:
    intrinsics = np.array([100.0, 100.0, 32.0, 24.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return Device(intrinsics, np.ones(9, bool), np.zeros(3), np.array([-x_m, 0.0, 0.0]))


def triangulated(name: str, baseline_m: float, depth_m: float, expected) -> Row:
    """Depth of a point straight ahead, seen from two places."""

    def run() -> np.ndarray:
        seen = np.array([[32.0, 24.0], [40.0, 24.0]])
        panel = seen - np.array([100.0 * baseline_m / depth_m, 0.0])
        points, gaps = triangulate(device(0.0), device(baseline_m), Correspondences(seen, panel))
        return np.concatenate([points[:, 2] / depth_m, 1.0 + gaps])

    return Row(STAGE, f"triangulation: {name}", run, expected)


def board(name: str, words: str, columns: int, rows: int, square_m: float) -> Row:
    return Row(
        STAGE, f"board: {name}", lambda: float(Chessboard(columns, rows, square_m).columns), Refused(words)
    )


def blank(name: str, image: np.ndarray) -> Row:
    """No board is found where none is."""
    run = lambda: float(Chessboard(7, 5, 0.03).detect(image) is None)  # noqa: E731
    return Row(STAGE, f"board: {name}", run, Near(1.0))


def built(name: str, expected, boards: int) -> Row:
    """Whether the model that came out says what is wrong with it."""

    def run() -> float:
        points = Chessboard(4, 3, 0.1).points_m + np.array([-0.15, -0.1, 1.0])
        pixels = points[:, :2] / points[:, 2:] * 100.0 + np.array([32.0, 24.0])
        rows = (tuple(map(tuple, points.tolist())), tuple(map(tuple, pixels.tolist())))
        seen = tuple(SeenBoard(f"board {n}", "0", *rows) for n in range(boards))
        found = model.build(Record(camera="camera", camera_size_px=(64, 48), boards=seen))
        return float(len(found.camera_optics.quality.advice) > 0)

    return Row(STAGE, f"model: {name}", run, expected)


SLANT = np.stack(
    [*np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-1, 1, 8)), np.full((8, 8), 3.0)], -1
).reshape(-1, 3)
SAME = lambda frames: frames  # noqa: E731

ROWS = [
    registered("two dark pictures", flat(0.0, 96, 128), flat(0.0, 96, 128), Refused("no texture")),
    registered("two saturated pictures", flat(1.0, 96, 128), flat(1.0, 96, 128), Refused("no texture")),
    registered("two grey pictures", flat(0.5, 96, 128), flat(0.5, 96, 128), Refused("no texture")),
    registered("nothing moved", WAVES, WAVES, Near(0.0, abs=1e-6)),
    registered("0.001 px", WAVES, waves(96, 128, 1e-3), Near(1e-3, rel=0.02)),
    registered("1 px", WAVES, waves(96, 128, 1.0), Near(1.0, rel=0.01)),
    registered("a lamp of half the light", WAVES, 0.5 * waves(96, 128, 0.1), Near(0.1, rel=0.02)),
    registered("16-bit counts", (WAVES * 65_535).astype(np.uint16), (waves(96, 128, 0.1) * 65_535).astype(np.uint16),
               Near(0.1, rel=0.02)),
    registered("8-bit counts", (WAVES * 255).astype(np.uint8), (waves(96, 128, 0.1) * 255).astype(np.uint8),
               Near(0.1, rel=0.05)),
    registered("pictures of two sizes", WAVES, waves(64, 64), Refused("one size")),
    registered("a mask of one pixel", WAVES, WAVES, Refused("Widen it"), np.eye(96, 128, dtype=bool)),
    registered("a pixel that is NaN", np.where(BORDER, np.nan, WAVES), WAVES, Refused("not finite")),
    Row(STAGE, "drift of marks and light", lambda: register(WAVES, WAVES, BORDER).shift_std_px, Within(0.0, 1e-3)),
    decoded("a perfect panel", SAME, Near(1.0)),
    decoded("darkness", lambda f: f * 0, Near(0.0)),
    decoded("saturation", lambda f: f * 0 + 255, Near(0.0)),
    decoded("16 bits", lambda f: f.astype(np.uint16) * 257, Near(1.0)),
    decoded("one count of contrast", lambda f: (f > 0).astype(np.uint8), Near(1.0)),
    decoded("a frame missing", lambda f: f[:-1], Refused("Gray-code frames")),
    decoded("white and black swapped", lambda f: np.concatenate([f[:-2], f[-1:], f[-2:-1]]), Near(0.0)),
    decoded("a panel of 8 x 8", SAME, Near(1.0), (8, 8)),
    wall("darkness", lambda f: f * 0, Refused("decode smoothly")),
    wall("saturation", lambda f: f * 0 + 255, Refused("decode smoothly")),
    plane("a wall at 3 m", SLANT, Near(3.0)),
    plane("a wall at 1000 m", SLANT * 333.33333, Near(1000.0, rel=1e-6)),
    plane("a wall at 1 cm", SLANT * 1e-2 / 3, Near(0.01, rel=1e-12)),
    plane("two points", SLANT[:2], Refused("points")),
    plane("a line", SLANT[:8], Refused("line")),
    triangulated("a baseline of 10 m at 30 m", 10.0, 30.0, Near(1.0, rel=1e-6)),
    triangulated("a baseline of 1 mm at 3 m", 1e-3, 3.0, Near(1.0, rel=1e-6)),
    triangulated("no baseline", 0.0, 3.0, Refused("one place|baseline")),
    board("squares in millimetres", "75 mm is 0.075", 9, 7, 75.0),
    board("squares of 0", "above 0", 9, 7, 0.0),
    board("two corners", "at least 3 x 3", 2, 1, 0.03),
    blank("darkness", np.zeros((96, 128), np.uint8)),
    blank("saturation, 16 bits", np.full((96, 128), 65_535, np.uint16)),
    blank("noise", np.random.default_rng(0).integers(0, 255, (96, 128)).astype(np.uint8)),
    blank("8 x 8 px", np.zeros((8, 8), np.uint8)),
    built("no board", Refused("at least 3"), 0),
    built("two boards", Refused("at least 3"), 2),
    built("the same board three times", Near(1.0), 3),
]  # fmt: skip


@extremes(ROWS)
def test_calibration_at_its_limits(row: Row, record_property):
    cv2.setRNGSeed(0)
    prove(row, record_property)
