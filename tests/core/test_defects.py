"""Defect pixels are found on a bare wall and in a texture, and a texture has none."""

import numpy as np
import pytest
from scipy import ndimage

from core.defects import without_defects

FINEST_PX = 5.0


def textures() -> list[np.ndarray]:
    rows, columns = np.mgrid[:64, :64].astype(np.float32)
    wave = 2 * np.pi / FINEST_PX
    along_diagonals = np.cos(wave * rows / 2**0.5) * np.cos(wave * columns / 2**0.5)
    crossed = np.cos(wave * rows) + np.cos(wave * columns)
    drawn = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(64, 64)), 1.2)
    return [0.5 + 0.1 * np.asarray(one, np.float32) for one in (along_diagonals, crossed, drawn)]


@pytest.mark.parametrize("number", range(3))
def test_a_texture_as_fine_as_patterns_are_has_no_defect(number: int):
    image = textures()[number]

    assert without_defects(image) is image


def test_noise_alone_has_hardly_any():
    noise = np.random.default_rng(0).normal(0.5, 1e-3, (1500, 1500)).astype(np.float32)

    # What is taken for one is replaced by its prediction: as much noise, or less.
    assert (without_defects(noise) != noise).mean() < 1e-4


@pytest.mark.parametrize("level", [1.0, 0.0])
def test_hot_and_dead_pixels_on_a_bare_wall_are_replaced_by_what_is_around(level: float):
    bare = np.random.default_rng(2).normal(0.3, 1e-3, (80, 90)).astype(np.float32)
    spoilt = bare.copy()
    places = (np.array([3, 40, 77]), np.array([5, 60, 87]))
    spoilt[places] = level

    repaired = without_defects(spoilt)

    assert np.abs(repaired[places] - 0.3).max() < 5e-3
    untouched = np.ones(bare.shape, bool)
    untouched[places] = False
    np.testing.assert_array_equal(repaired[untouched], spoilt[untouched])
    # What was given is as it was.
    assert spoilt[3, 5] == level


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("level", [1.0, 0.0])
def test_those_in_a_texture_are_as_well(level: float, number: int):
    image = textures()[number]
    places = (np.array([5, 40, 60]), np.array([7, 30, 55]))
    spoilt = image.copy()
    spoilt[places] = level

    repaired = without_defects(spoilt)

    left = np.abs(repaired - image)
    assert left.max() < 0.25 * np.abs(spoilt - image)[places].min()
    untouched = np.ones(image.shape, bool)
    untouched[places] = False
    np.testing.assert_array_equal(repaired[untouched], image[untouched])


def test_a_picture_without_inner_pixels_is_left_alone():
    image = np.zeros((2, 9), np.float32)

    assert without_defects(image) is image


def test_a_defect_is_replaced_and_not_its_neighbour_where_the_texture_is_smooth_along_an_axis():
    """A pixel may weigh more than 1 in its neighbour's prediction: what is left is then largest beside the defect."""
    random = np.random.default_rng(3)
    drawn = 0.5 + ndimage.gaussian_filter(random.normal(size=(200, 200)), 1.0)
    # A part of the picture is a bare wall.
    drawn[:, 120:] = 0.02
    blurred = ndimage.gaussian_filter(drawn, (0.8, 3.0)) + 1e-5 * random.normal(size=drawn.shape)
    image = blurred.astype(np.float32)
    spoilt = image.copy()
    spoilt[100, 160] = 1.0

    repaired = without_defects(spoilt)

    assert np.abs(repaired - image)[90:111, 150:171].max() < 1e-3
