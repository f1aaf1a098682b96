"""What spoils the pictures of a simulated rig: a lens, a lamp, a shaking mount, pixels, things before the wall.

Each acts on the picture's luminance, in the order in which light meets it. What changes from burst to burst is drawn
from the seed and the burst's number: the same burst looks the same again.
"""

import numpy as np
from jaxtyping import Bool, Float32
from scipy import ndimage

from app.experiment.rig_settings import World

Picture = Float32[np.ndarray, "rows cols"]

# Luminance of a pixel that is always full.
_FULL = 1.0
# Things before the wall: so many, and how far those that move do, as a share of their width.
_THINGS, _MOVED = 4, 0.2


def spoiled(picture: Picture, world: World, burst: int, seed: int) -> Picture:
    """The picture as this world shows it in one burst."""
    own = np.random.default_rng([seed, 101, burst])
    spoiled = picture if world.covered == 0.0 else _behind_things(picture, world.covered, burst, seed)
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


def _behind_things(picture: Picture, share: float, burst: int, seed: int) -> Picture:
    hidden = picture.copy()
    for n, (rows, columns) in enumerate(_things(picture.shape, share, burst, seed)):
        fine = np.random.default_rng([seed, 103, n]).standard_normal(picture[rows, columns].shape)
        hidden[rows, columns] = np.clip(0.4 + ndimage.gaussian_filter(fine, 2.0), 0.02, 0.9)
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
