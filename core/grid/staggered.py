"""Where the unknowns of a staggered grid sit, and their values anywhere in the box.

With n cells an axis: T at cell centres with one ghost layer around the box, p at cell centres, each
velocity component on the faces across its own axis (the box's faces included) with one ghost layer
along the two other axes. A wall value is the mean of ghost and first cell: an unknown wall is simply a
free ghost layer.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.grid.interpolation import at_points, interpolation_matrix, on_axes, on_axes_together
from core.losses.boussinesq import FlowValues

Corner = tuple[float, float, float]
Shape = tuple[int, int, int]
Axes = tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"], Float[np.ndarray, " _"]]
Volume = Float[Array, "_ _ _"]


class Staggered(eqx.Module):
    """T, p, u, v, w, each with its own shape (see the module)."""

    temperature: Volume
    pressure: Volume
    velocity: tuple[Volume, Volume, Volume]

    @property
    def components(self) -> tuple[Volume, ...]:
        """The five arrays in the order T, p, u, v, w."""
        return (self.temperature, self.pressure, *self.velocity)

    @staticmethod
    def of(components: Sequence[Volume]) -> "Staggered":
        """The inverse of `components`."""
        t, p, u, v, w = components
        return Staggered(t, p, (u, v, w))


class StaggeredGrid(eqx.Module):
    """Cells of a box in nondimensional coordinates."""

    lower: Corner = eqx.field(static=True)
    upper: Corner = eqx.field(static=True)
    cells: Shape = eqx.field(static=True)

    @property
    def spacing(self) -> Corner:
        """Cell size along x, y, z."""
        dx, dy, dz = ((u - low) / n for low, u, n in zip(self.lower, self.upper, self.cells, strict=True))
        return dx, dy, dz

    @property
    def axes(self) -> tuple[Axes, ...]:
        """The coordinates of every unknown along x, y, z, for each of T, p, u, v, w."""
        ghosted, centres, faces = (
            [self._along(axis, kind) for axis in range(3)] for kind in ("ghosted", "centres", "faces")
        )
        velocity = [[faces[a] if a == c else ghosted[a] for a in range(3)] for c in range(3)]
        return tuple((x, y, z) for x, y, z in (ghosted, centres, *velocity))

    def zeros(self) -> Staggered:
        """All unknowns zero, float32."""
        return Staggered.of([jnp.zeros([len(a) for a in axes], jnp.float32) for axes in self.axes])

    def matrices(self, targets: Sequence[Axes]) -> tuple[tuple[Float[np.ndarray, "_ _"], ...], ...]:
        """Interpolation matrices from each unknown's axes to `targets` (five axis triples, T to w)."""
        return tuple(
            tuple(interpolation_matrix(k, t) for k, t in zip(knots, target, strict=True))
            for knots, target in zip(self.axes, targets, strict=True)
        )

    def on_grid(self, state: Staggered, axes: Axes) -> FlowValues:
        """T, p, u on a tensor grid of points, nondimensional."""
        values = on_axes_together(state.components, self.matrices([axes] * 5))
        return FlowValues(values[0], values[1], jnp.stack(values[2:], axis=-1))

    def at(self, state: Staggered, points: Float[Array, "points 3"]) -> FlowValues:
        """T, p, u at scattered points, nondimensional."""
        values = [
            at_points(component, knots, points)
            for component, knots in zip(state.components, self.axes, strict=True)
        ]
        return FlowValues(values[0], values[1], jnp.stack(values[2:], axis=-1))

    def of_fields(self, axes: Axes, flow: FlowValues) -> Staggered:
        """Sample fields that are given on a tensor grid at this grid's unknowns (linear)."""
        given = (flow.temperature, flow.pressure, *(flow.velocity[..., c] for c in range(3)))
        sampled = []
        for values, target in zip(given, self.axes, strict=True):
            matrices = [interpolation_matrix(k, t) for k, t in zip(axes, target, strict=True)]
            sampled.append(on_axes(values, matrices))
        return Staggered.of(sampled)

    def _along(self, axis: int, kind: str) -> Float[np.ndarray, " n"]:
        n, step = self.cells[axis], self.spacing[axis]
        index = {
            "ghosted": np.arange(-1, n + 1) + 0.5,
            "centres": np.arange(n) + 0.5,
            "faces": np.arange(n + 1.0),
        }[kind]
        return self.lower[axis] + step * index
