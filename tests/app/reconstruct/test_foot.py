"""Down to which row a thing is seen below the wall."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from app.reconstruct.foot import foot_row

COLUMNS, FIRST = slice(100, 140), 20


def floor(kind, seed):
    rng = np.random.default_rng(seed)
    noise = 2e-3 * rng.standard_normal((90, 400))
    if kind == "bare":
        picture = noise
    elif kind == "plain":
        picture = 0.35 + 0.02 * np.linspace(-1, 1, 400)[None, :] + noise
    else:
        fine = gaussian_filter(rng.standard_normal((90, 400)), 1.5)
        picture = 0.5 + 0.15 * fine / fine.std() + noise
    return picture.astype(np.float32)


def free():
    columns = np.ones(400, bool)
    columns[90:150] = False
    return columns


def thing(picture, last):
    """Something with folds and its own light, down to row `last`."""
    rows, columns = np.mgrid[: len(picture), : picture.shape[1]]
    folds = 0.42 + 0.1 * np.sin(columns / 7.0) * np.sin(rows / 9.0)
    hidden = picture.copy()
    inside = np.s_[: last + 1, 92:148]
    hidden[inside] = folds[inside] + (hidden[inside] - picture[inside])
    return hidden.astype(np.float32)


@pytest.mark.parametrize("kind", ["bare", "plain", "print"])
@pytest.mark.parametrize("seed", range(5))
def test_a_foot_is_seen_to_a_row_before_any_floor(kind, seed):
    last = 41 + 3 * seed
    # A row may look like the floor or like the thing by chance.
    assert foot_row(thing(floor(kind, seed), last), FIRST, COLUMNS, free()) == pytest.approx(last, abs=2)


@pytest.mark.parametrize("kind", ["bare", "plain", "print"])
def test_a_thing_that_goes_on_is_seen_to_the_last_row(kind):
    assert foot_row(thing(floor(kind, 1), 89), FIRST, COLUMNS, free()) == 89


@pytest.mark.parametrize("kind", ["bare", "plain", "print"])
def test_a_floor_alone_shows_no_foot(kind):
    assert all(foot_row(floor(kind, seed), FIRST, COLUMNS, free()) is None for seed in range(10))


def test_without_enough_floor_beside_it_nothing_is_said():
    narrow = free()
    narrow[:50] = narrow[200:] = False
    assert foot_row(thing(floor("bare", 0), 50), FIRST, COLUMNS, narrow) is None
    assert foot_row(thing(floor("bare", 0), 50), 90, COLUMNS, free()) is None
