"""A linear sensor: luminance -> electrons -> counts, with shot noise, read noise, dark level, digitisation.

    counts = clip(round(dark + k (P(E) + read_noise_e z))),   k = gain (full scale - dark) / full well

P(E) is Poisson; from `GAUSSIAN_FROM_E` electrons on it is drawn as E + sqrt(E) z, whose skewness
1/sqrt(E) is then below 0.15. Each block of rows has a generator of its own, seeded by (seed, sequence,
block): a frame does not depend on the number of threads, and frame 17 can be had again without the others.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from drivers.protocols import Pixels

GAUSSIAN_FROM_E = 50.0
ROWS_PER_BLOCK = 64

Luminance = Float32[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class SensorNoise:
    """Full well and read noise in electrons, dark level in counts at gain 1, bits of the digitiser."""

    full_well_e: float = 10_000.0
    read_noise_e: float = 3.0
    dark_counts: float = 64.0
    bits: int = 12

    @property
    def full_scale_counts(self) -> int:
        """Largest count."""
        return 2**self.bits - 1

    @property
    def dtype(self) -> type[np.uint8] | type[np.uint16]:
        """The raw frame's dtype."""
        return np.uint8 if self.bits <= 8 else np.uint16


@dataclass(frozen=True)
class ExpectedCounts:
    """Mean and standard deviation of every pixel, ready to be drawn from; made once a view."""

    noise: SensorNoise
    counts_per_e: float
    mean: Luminance
    std: Luminance
    few_photons: tuple[np.ndarray, ...]

    @classmethod
    def of(
        cls, luminance: Luminance, noise: SensorNoise, exposure_factor: float, gain: float
    ) -> "ExpectedCounts":
        """Return expected counts of `luminance`, 1 of which fills the well at exposure factor 1."""
        k = gain * (noise.full_scale_counts - noise.dark_counts) / noise.full_well_e
        electrons = luminance * np.float32(noise.full_well_e * exposure_factor)
        np.clip(electrons, 0.0, 2.0 * noise.full_well_e, out=electrons)
        few = (electrons > 0.0) & (electrons < GAUSSIAN_FROM_E)
        blocks = tuple(np.flatnonzero(few[row : row + ROWS_PER_BLOCK]) for row in _blocks(len(few)))
        std = np.sqrt(electrons + np.float32(noise.read_noise_e**2)) * np.float32(k)
        electrons *= np.float32(k)
        electrons += np.float32(noise.dark_counts)
        return cls(noise, k, electrons, std, blocks)

    def draw(
        self, seed: int, sequence: int, executor: Executor | None = None, brightness: float = 1.0
    ) -> Pixels:
        """Return one frame of counts; the same arguments give the same frame.

        `brightness` is that of the light in this frame; the noise is that of a brightness of 1.
        """
        frame = np.empty(self.mean.shape, self.noise.dtype)
        each: Callable = executor.map if executor else map
        for _ in each(
            lambda row: self._draw_block(frame, row, seed, sequence, brightness), _blocks(len(frame))
        ):
            pass
        return frame

    def _draw_block(self, frame: np.ndarray, row: int, seed: int, sequence: int, brightness: float) -> None:
        block = row // ROWS_PER_BLOCK
        random = np.random.Generator(np.random.SFC64([seed, sequence, block]))
        rows = slice(row, row + ROWS_PER_BLOCK)
        counts = random.standard_normal(self.mean[rows].shape, dtype=np.float32)
        few = self.few_photons[block]
        dim = self._draw_dim(random, self.mean[rows].ravel()[few], counts.ravel()[few]) if few.size else None
        counts *= self.std[rows]
        counts += self.mean[rows]
        if dim is not None:
            counts.ravel()[few] = dim
        if brightness != 1.0:
            counts += np.float32(brightness - 1.0) * (self.mean[rows] - np.float32(self.noise.dark_counts))
        counts += np.float32(0.5)
        np.clip(counts, 0.0, self.noise.full_scale_counts + 0.5, out=counts)
        frame[rows] = counts

    def _draw_dim(self, random: np.random.Generator, mean: np.ndarray, normal: np.ndarray) -> np.ndarray:
        expected_e = (mean - self.noise.dark_counts) / self.counts_per_e
        electrons = random.poisson(np.maximum(expected_e, 0.0)) + self.noise.read_noise_e * normal
        return (self.noise.dark_counts + self.counts_per_e * electrons).astype(np.float32)


def _blocks(rows: int) -> range:
    return range(0, rows, ROWS_PER_BLOCK)
