"""Where to hold a board so that several cameras see it whole: by what is stated of the cameras."""

from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from core.geometry import Box, Optics, Vector3

# How many places of the room are tried, and the tilts about the board's axes that tell its sides apart [rad].
_TRIED, _TILT_RAD = 4000, 0.3
# A board's corners are found to here: beyond 60 degrees a square is less than half as wide as high.
_LEAST_FACING = 0.5
# As the guide: a board with its outer squares and white margin, against what its points span.
_WITH_MARGIN = 1.5


def common_places(
    cameras: tuple[Optics, ...], room: Box, board_size_m: Float[np.ndarray, "2"], count: int, seed: int = 0
) -> list[tuple[Vector3, Float[np.ndarray, "3 3"]]]:
    """Up to `count` places that two cameras or more see: centre and axes of the board in the room.

    The board's y axis hangs down, it faces halfway between the cameras, a little tilted to another side at each
    place. Places lie as far apart as possible; as many are for each pair of cameras that has any.
    """
    rng = np.random.default_rng(seed)
    found: dict[tuple[int, int], list] = {}
    for pair in combinations(range(len(cameras)), 2):
        both = [cameras[n] for n in pair]
        places = []
        for _ in range(_TRIED):
            centre_m = rng.uniform(room.lower_m, room.upper_m)
            axes = (
                _facing(both, centre_m)
                @ Rotation.from_euler("xyz", [*rng.uniform(-_TILT_RAD, _TILT_RAD, 2), 0.0]).as_matrix()
            )
            if all(_sees(camera, centre_m, axes, board_size_m) for camera in both):
                places.append((centre_m, axes))
        if places:
            found[pair] = _spread(places, count)
    chosen = []
    for turn in range(count):
        chosen += [places[turn] for places in found.values() if turn < len(places)]
    return [((float(c[0]), float(c[1]), float(c[2])), axes) for c, axes in chosen[:count]]


def _facing(cameras: list[Optics], centre_m: np.ndarray) -> Float[np.ndarray, "3 3"]:
    """Axes of a board that faces halfway between the cameras: columns x, y (down) and away from them."""
    towards = [centre_m - np.array(camera.position_m) for camera in cameras]
    away = np.sum([t / np.linalg.norm(t) for t in towards], axis=0)
    away = away / max(float(np.linalg.norm(away)), 1e-9)
    # Down is what the first camera calls down: gravity's, for a camera that looks along the floor.
    down = cameras[0].rotation[1]
    down = down - (down @ away) * away
    down = down / max(float(np.linalg.norm(down)), 1e-9)
    return np.stack([np.cross(down, away), down, away], axis=1)


def _sees(camera: Optics, centre_m: np.ndarray, axes: np.ndarray, board_size_m: np.ndarray) -> bool:
    """Whether the whole board with its margin lies in the picture, and faces the camera well enough."""
    towards = centre_m - np.array(camera.position_m)
    if float(axes[:, 2] @ towards) < _LEAST_FACING * float(np.linalg.norm(towards)):
        return False
    half = 0.5 * _WITH_MARGIN * board_size_m
    corners = [
        centre_m + sx * half[0] * axes[:, 0] + sy * half[1] * axes[:, 1] for sx in (-1, 1) for sy in (-1, 1)
    ]
    local = (np.array(corners) - np.array(camera.position_m)) @ camera.rotation.T
    if local[:, 2].min() <= 0:
        return False
    pixels = local[:, :2] / local[:, 2:] * camera.focal_px + camera.principal_px
    return bool(
        (pixels > 0).all()
        and (pixels[:, 0] < camera.width_px).all()
        and (pixels[:, 1] < camera.height_px).all()
    )


def _spread(places: list, count: int) -> list:
    """Places far from one another: each next one is the farthest from those chosen."""
    centres = np.array([centre for centre, _ in places])
    chosen = [int(np.argmin(np.linalg.norm(centres - centres.mean(axis=0), axis=1)))]
    apart = np.linalg.norm(centres - centres[chosen[0]], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(centres - centres[chosen[-1]], axis=1))
    return [places[n] for n in chosen]
