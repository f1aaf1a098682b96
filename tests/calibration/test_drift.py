import numpy as np
import pytest
from scipy import ndimage

from calibration.drift import _after, measure_drift
from calibration.errors import ImageError
from calibration.registration import FiniteSimilarity, border_mask, register

SIZE = 384


def texture(seed: int) -> np.ndarray:
    """Band-limited noise about one half."""
    rng = np.random.default_rng(seed)
    octaves = [ndimage.gaussian_filter(rng.standard_normal((SIZE, SIZE)), s) for s in (1.0, 2.0, 4.0)]
    total = sum(o / o.std() for o in octaves)
    return 0.5 + 0.15 * total / total.std()


def moved(picture: np.ndarray, motion: FiniteSimilarity, plume_px: float = 0.0) -> np.ndarray:
    """The picture after the motion (quintic splines), with a plume's shift in the middle."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    back = np.linalg.inv(motion.matrix)
    u, v = (back[k, 0] * x + back[k, 1] * y + back[k, 2] for k in (0, 1))
    plume = plume_px * np.exp(-((x - SIZE / 2) ** 2 + (y - SIZE / 2) ** 2) / (2 * 45.0**2))
    return ndimage.map_coordinates(picture, [v, u - plume], order=5, mode="mirror")


def counts(picture: np.ndarray, seed: int) -> np.ndarray:
    """One frame of a 10-bit camera with a 10 ke- full well."""
    electrons = np.random.default_rng(seed).poisson(np.clip(picture, 0, None) * 8000.0)
    return np.clip(np.rint(electrons * 0.1007 + 16), 0, 1023).astype(np.uint16)


def similarity(x: float, y: float, degrees: float = 0.0) -> FiniteSimilarity:
    return FiniteSimilarity(np.array([x, y]), float(np.deg2rad(degrees)), 1.0, np.full(2, (SIZE - 1) / 2))


CORNERS = np.array([[0.0, 0.0], [SIZE - 1, 0.0], [0.0, SIZE - 1], [SIZE - 1, SIZE - 1]])


def test_a_similarity_is_found_to_a_hundredth_of_a_pixel_from_the_border_alone():
    truth = similarity(0.2, -0.1, 0.01)
    picture = texture(1)
    reference, flow = counts(picture, 2), counts(moved(picture, truth, plume_px=0.6), 3)

    found = register(reference, flow, border_mask((SIZE, SIZE), 64))

    assert found.converged
    error = found.motion.displacement_px(CORNERS) - truth.displacement_px(CORNERS)
    assert np.abs(error).max() < 0.01
    # And it knows how well: the shift's deviation is of the error's order.
    assert 2e-4 < found.shift_std_px < 5e-3


def test_the_whole_picture_would_have_taken_the_plume_for_drift():
    truth = similarity(0.2, -0.1, 0.01)
    picture = texture(1)
    found = register(counts(picture, 2), counts(moved(picture, truth, 0.6), 3), np.ones((SIZE, SIZE), bool))
    assert abs(found.motion.shift_px[0] - 0.2) > 0.02


def test_camera_and_projector_are_told_apart_by_printed_marks():
    camera, projector = similarity(0.3, 0.1, 0.02), similarity(-0.15, 0.05)
    marks = np.zeros((SIZE, SIZE), bool)
    for top, left in ((4, 4), (4, 300), (300, 4), (300, 300)):
        marks[top : top + 76, left : left + 76] = True
    printed, pattern = texture(5), texture(6)
    both = FiniteSimilarity(np.zeros(2), 0.0, 1.0, camera.centre_px)
    both = similarity(*(projector.matrix @ camera.matrix @ [191.5, 191.5, 1])[:2] - 191.5, 0.02)
    reference = np.where(marks, printed, pattern)
    flow = np.where(marks, moved(printed, camera), moved(pattern, both))
    inner = ndimage.binary_erosion(marks, iterations=6)
    outer = border_mask((SIZE, SIZE), 70) & ~ndimage.binary_dilation(marks, iterations=10)

    drift = measure_drift(counts(reference, 7), counts(flow, 8), outer, inner)

    assert drift.camera is not None
    assert drift.projector is not None
    np.testing.assert_allclose(drift.camera.motion.shift_px, [0.3, 0.1], atol=0.01)
    np.testing.assert_allclose(drift.projector.shift_px, [-0.15, 0.05], atol=0.015)


def test_air_in_the_border_is_noticed():
    picture = texture(9)
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    plume = 0.4 * np.exp(-((x - 192) ** 2 + (y - 20) ** 2) / (2 * 40.0**2))
    flow = ndimage.map_coordinates(picture, [y, x - plume], order=5, mode="mirror")

    drift = measure_drift(counts(picture, 1), counts(flow, 2), border_mask((SIZE, SIZE), 64))

    assert any("moved by" in a and "on its own" in a for a in drift.advice)


def test_pictures_that_cannot_be_registered_are_refused():
    picture = texture(1)
    with pytest.raises(ImageError, match="expected one size"):
        register(picture, picture[:-1], border_mask((SIZE, SIZE), 10))
    with pytest.raises(ImageError, match="Widen it"):
        register(picture, picture, np.zeros((SIZE, SIZE), bool))
    with pytest.raises(ImageError, match="no texture"):
        register(np.ones((SIZE, SIZE)), np.ones((SIZE, SIZE)), border_mask((SIZE, SIZE), 64))


def test_the_projectors_motion_after_the_cameras_is_the_total():
    camera, total = similarity(12.0, -5.0, 3.0), similarity(4.0, 9.0, -2.0)
    projector = _after(camera, total)
    np.testing.assert_allclose(projector.matrix @ camera.matrix, total.matrix, atol=1e-9)
