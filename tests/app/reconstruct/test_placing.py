"""A thing's box from what it hides of the wall: exact for boxes as deep as they are wide or high."""

from itertools import product

import numpy as np
import pytest

from app.reconstruct.placing import Silhouette, box_of, meets_floor_m
from core.geometry import Box

ROOM = Box(lower_m=(-2.0, -1.5, 0.0), upper_m=(2.0, 1.5, 3.0))


def silhouette(lower_m, upper_m, eye_m):
    """By the eight corners, each seen on the wall."""
    corners = np.array(list(product(*zip(lower_m, upper_m, strict=True))))
    eye = np.array(eye_m)
    share = (corners[:, 1] - eye[1]) / (ROOM.upper_m[1] - eye[1])
    on_wall = eye + (corners - eye) / share[:, None]
    low, high = on_wall.min(axis=0), on_wall.max(axis=0)
    return Silhouette(eye_m, (low[0], high[0]), (low[2], high[2]))


@pytest.mark.parametrize("eye_m", [(0.0, -2.7, 1.5), (-1.9, -4.0, 0.9), (1.4, -29.0, 2.8)])
@pytest.mark.parametrize(
    ("lower_m", "upper_m"),
    [
        ((0.3, 0.2, 0.0), (0.7, 0.6, 1.2)),
        ((-1.7, -0.9, 0.0), (-0.9, -0.1, 2.1)),
        ((1.1, 0.4, 0.0), (1.9, 0.75, 0.35)),
    ],
)
def test_a_box_on_the_floor_is_found_from_its_silhouette_and_its_foot(lower_m, upper_m, eye_m):
    found = box_of(silhouette(lower_m, upper_m, eye_m), ROOM, lower_m[1], on_floor=True)

    # Its height is taken to the millimetre; its depth is the smaller of width and height.
    np.testing.assert_allclose(found, (lower_m, upper_m), atol=2e-3)


@pytest.mark.parametrize("eye_m", [(0.0, -2.7, 1.5), (-1.9, -4.0, 0.9)])
def test_a_box_on_the_wall_is_found_without_its_foot(eye_m):
    lower_m, upper_m = (0.4, 1.0, 1.7), (0.9, 1.5, 2.5)
    found = box_of(silhouette(lower_m, upper_m, eye_m), ROOM, None, on_floor=False)
    np.testing.assert_allclose(found, (lower_m, upper_m), atol=2e-3)


def test_a_box_stays_in_the_room_and_has_a_volume():
    """Also where what is seen reaches beyond the room, and where the foot seems to be behind the wall."""
    rng = np.random.default_rng(4)
    for _ in range(300):
        x, z = np.sort(rng.uniform(-2.0, 2.0, 2)), np.sort(rng.uniform(0.0, 3.0, 2))
        if min(np.diff(x)[0], np.diff(z)[0]) < 0.05:
            continue
        eye_m = (rng.uniform(-2.0, 2.0), rng.uniform(-30.0, -2.0), rng.uniform(0.2, 2.8))
        front = rng.choice([None, -3.0, rng.uniform(-1.5, 1.5), 1.6])
        lower, upper = box_of(Silhouette(eye_m, tuple(x), tuple(z)), ROOM, front, bool(rng.integers(2)))
        assert np.all(np.array(lower) >= ROOM.lower_m)
        assert np.all(np.array(upper) <= ROOM.upper_m)
        assert np.all(np.array(lower) < upper)


def test_a_ray_meets_the_floor_before_the_wall_where_it_looks_below_the_walls_edge():
    eye_m, foot_m = (0.0, -2.0, 1.5), (0.4, 0.3, 0.0)
    share = (foot_m[1] - eye_m[1]) / (1.5 - eye_m[1])
    seen = tuple(e + (f - e) / share for e, f in zip(eye_m, foot_m, strict=True))
    assert meets_floor_m(eye_m, seen, 0.0) == pytest.approx(0.3)
    assert meets_floor_m(eye_m, (0.4, 1.5, 1.6), 0.0) is None
