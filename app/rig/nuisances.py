"""What spoils the pictures of a simulated rig: a lens, a lamp, a shaking mount, pixels, things before the wall.

Each acts on the picture's luminance, in the order in which light meets it. What changes from burst to burst is drawn
from the seed and the burst's number: the same burst looks the same again.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

from app.experiment.rig_settings import World

Picture = Float32[np.ndarray, "rows cols"]
# Where points (column, row) of a picture were in the first burst's, before the mount crept.
Back = Callable[[Float[np.ndarray, "... 2"]], Float[np.ndarray, "... 2"]]

# Luminance of a pixel that is always full.
_FULL = 1.0
# Things before the wall: so many, and how far those that move do, as a share of their width.
_THINGS, _MOVED = 4, 0.2
# What is drawn beside a thing's own pixels, and how much more of it is painted: a mount creeps by less.
_RIM_PX, _MORE_PX = 4, 16


def spoiled(picture: Picture, world: World, burst: int, seed: int, back: Back = np.asarray) -> Picture:
    """The picture as this world shows it in one burst; things before the wall move with it as `back` says."""
    own = np.random.default_rng([seed, 101, burst])
    spoiled = picture if world.covered == 0.0 else _behind_things(picture, world.covered, burst, seed, back)
    spoiled = spoiled * (_light(picture.shape, world, own) * _vignette(picture.shape, world.vignetting))
    shake_px = world.vibration_px * own.uniform(0.5, 1.5)
    blur_px = float(np.hypot(world.blur_px, shake_px))
    if blur_px > 0.0:
        spoiled = ndimage.gaussian_filter(spoiled, blur_px, mode="nearest")
    return _with_hot_pixels(spoiled.astype(np.float32), world.hot_pixels, seed)


def covered(
    shape: tuple[int, int], world: World, bursts: tuple[int, ...], seed: int
) -> Bool[np.ndarray, "rows cols"]:
    """Where a thing is before the wall in one of these bursts: what a mask should find."""
    hidden = np.zeros(shape, bool)
    for burst in bursts:
        for rows, columns in _things(shape, world.covered, burst, seed):
            hidden[rows, columns] = True
    return hidden


def _behind_things(picture: Picture, share: float, burst: int, seed: int, back: Back) -> Picture:
    hidden = picture.copy()
    height, width = picture.shape
    for n, (rows, columns) in enumerate(_things(picture.shape, share, burst, seed)):
        wide = tuple(
            slice(max(part.start - _RIM_PX, 0), min(part.stop + _RIM_PX, length))
            for part, length in ((rows, height), (columns, width))
        )
        at_rows, at_columns = np.mgrid[wide].astype(float)
        was = back(np.stack([at_columns, at_rows], axis=-1))
        shape = (rows.stop - rows.start + 2 * _MORE_PX, columns.stop - columns.start + 2 * _MORE_PX)
        fine = np.random.default_rng([seed, 103, n]).standard_normal(shape)
        paint = np.clip(0.4 + ndimage.gaussian_filter(fine, 2.0), 0.02, 0.9)
        # A thing goes on below the picture.
        there = np.zeros(shape)
        there[_MORE_PX:, _MORE_PX:-_MORE_PX] = 1.0
        at = [was[..., 1] - (rows.start - _MORE_PX), was[..., 0] - (columns.start - _MORE_PX)]
        cover = ndimage.map_coordinates(there, at, order=1, mode="nearest")
        painted = ndimage.map_coordinates(paint, at, order=5, mode="nearest")
        hidden[wide] = (1.0 - cover) * hidden[wide] + cover * painted
    return hidden


def _things(shape: tuple[int, int], share: float, burst: int, seed: int) -> list[tuple[slice, slice]]:
    """Rows and columns of each thing: upright rectangles on the lower part of the picture, side by side."""
    if share == 0.0:
        return []
    height, width = shape
    rng = np.random.default_rng([seed, 102])
    tall = int(height * min(1.0, np.sqrt(2.0 * share)))
    wide = int(share * height * width / (_THINGS * max(tall, 1)))
    things = []
    for n in range(_THINGS):
        room = width // _THINGS - wide
        first = n * (width // _THINGS) + int(rng.uniform(0.25, 0.5) * max(room, 0))
        first += (n % 2) * burst * int(_MOVED * wide)
        things.append((slice(height - tall, height), slice(first, min(first + wide, width))))
    return things


def _light(shape: tuple[int, int], world: World, own: np.random.Generator) -> np.ndarray:
    """The light on the wall: its level, and a ripple of any direction and phase."""
    level = 1.0 + world.lamp * own.uniform(-1.0, 1.0)
    angle, phase = own.uniform(0.0, 2.0 * np.pi, 2)
    along = np.cos(angle) * np.arange(shape[1])[None, :] + np.sin(angle) * np.arange(shape[0])[:, None]
    return level * (1.0 + world.ripple * np.sin(2.0 * np.pi * along / world.ripple_period_px + phase))


def _vignette(shape: tuple[int, int], missing: float) -> np.ndarray:
    """1 in the middle, less by this share in the corners, with the square of the distance."""
    y, x = (np.linspace(-1.0, 1.0, n) for n in shape)
    return 1.0 - missing * 0.5 * (x[None, :] ** 2 + y[:, None] ** 2)


def _with_hot_pixels(picture: Picture, share: float, seed: int) -> Picture:
    if share == 0.0:
        return picture
    hot = np.random.default_rng([seed, 104]).random(picture.shape) < share
    return np.where(hot, np.float32(_FULL), picture)
