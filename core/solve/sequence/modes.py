"""Cosines of a room: waves in which turbulent air that is alike everywhere is independent, but for its walls."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from core.geometry import Box
from core.known_temperature import VertexGrid

Axes = tuple[Float[np.ndarray, " nx"], Float[np.ndarray, " ny"], Float[np.ndarray, " nz"]]


@dataclass(frozen=True)
class Modes:
    """Cosines of a box with free ends: how often each changes sign along x, y, z. The longest come first."""

    box: Box
    waves: Int[np.ndarray, "modes 3"]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.waves)

    @property
    def grid(self) -> VertexGrid:
        """Vertices that hold them: four a wave of the shortest."""
        most = self.waves.max(axis=0)
        return VertexGrid(self.box, (2 * int(most[0]) + 2, 2 * int(most[1]) + 2, 2 * int(most[2]) + 2))

    @property
    def finest_per_m(self) -> float:
        """The largest wave number [rad/m]."""
        return float(self._per_m.max())

    @property
    def _per_m(self) -> Float[np.ndarray, " modes"]:
        return np.linalg.norm(np.pi * self.waves / np.array(self.box.size_m), axis=1)

    def some(self, first: int, last: int) -> "Modes":
        """Those from the first to before the last."""
        return Modes(self.box, self.waves[first:last])

    def fields(self, axes_m: Axes) -> Float[np.ndarray, "modes nx ny nz"]:
        """Each of them on vertices, of mean square 1 over the box."""
        x, y, z = (_along(self.box, self.waves[:, axis], axis, at_m) for axis, at_m in enumerate(axes_m))
        return np.einsum("mx,my,mz->mxyz", x, y, z, optimize=True)

    def sum(self, weights: Float[np.ndarray, " modes"], axes_m: Axes) -> Float[np.ndarray, "nx ny nz"]:
        """The field of these weights on vertices."""
        tensor = np.zeros(tuple(self.waves.max(axis=0) + 1))
        tensor[tuple(self.waves.T)] = weights
        for axis, at_m in enumerate(axes_m):
            # The axis that is done goes last: after three of them the order is x, y, z again.
            waves = np.arange(tensor.shape[0])
            tensor = np.moveaxis(tensor, 0, -1) @ _along(self.box, waves, axis, at_m)
        return tensor

    def amplitudes(self, length_m: float) -> Float[np.ndarray, " modes"]:
        """Standard deviation of each weight in a turbulent field of variance 1 (mean over the box) and this length.

        Von Karman's spectrum of a scalar in isotropic turbulence, (1 + k^2 length^2)^(-11/6): Pope (2000), 6.5.3.
        """
        size = (1.0 + (self._per_m * length_m) ** 2) ** (-11 / 12)
        return size / np.linalg.norm(size)


def _along(
    box: Box, waves: Int[np.ndarray, " modes"], axis: int, at_m: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "modes points"]:
    """Cosines along one axis, of mean square 1."""
    share = (np.asarray(at_m, np.float64) - box.lower_m[axis]) / box.size_m[axis]
    return np.where(waves > 0, 2**0.5, 1.0)[:, None] * np.cos(np.pi * waves[:, None] * share)


def longest(box: Box, count: int) -> Modes:
    """The `count` longest waves of a box."""
    # As many as these lie below the wave number of the last one.
    per_m = 2.0 * (6.0 * count / np.pi / np.prod(box.size_m)) ** (1 / 3)
    ranges = [np.arange(int(per_m * size_m) + 2) for size_m in box.size_m]
    waves = np.stack(np.meshgrid(*ranges, indexing="ij"), -1).reshape(-1, 3)
    order = np.argsort(np.linalg.norm(waves / np.array(box.size_m), axis=1), kind="stable")
    return Modes(box, waves[order[:count]])
