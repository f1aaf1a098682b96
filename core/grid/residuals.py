"""The Boussinesq residuals of a staggered grid: second order, and conservative.

Mass is balanced over cells, heat over cells, momentum over the boxes around inner faces; every flux
leaves one box and enters the next, so sums over the room are fluxes through its walls to rounding.
Central interpolation: second order where the flow is smooth, oscillating where a cell's Péclet number
is far above 2 and nothing else holds it.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from core.grid.staggered import Staggered, StaggeredGrid
from core.losses.boussinesq import Numbers, Residuals

Volume = Float[Array, "_ _ _"]


def discrete_residuals(
    state: Staggered, grid: StaggeredGrid, numbers: Numbers
) -> tuple[Volume, tuple[Volume, Volume, Volume], Volume]:
    """Mass (cells), momentum (inner faces along x, y, z) and heat (cells), nondimensional."""
    mass = sum(
        (
            _difference(_inner(state.velocity[axis], _others(axis)), axis) / grid.spacing[axis]
            for axis in range(1, 3)
        ),
        start=_difference(_inner(state.velocity[0], _others(0)), 0) / grid.spacing[0],
    )
    momentum = (
        _momentum(0, state, grid, numbers),
        _momentum(1, state, grid, numbers),
        _momentum(2, state, grid, numbers),
    )
    return mass, momentum, _heat(state, grid, numbers)


def _momentum(c: int, state: Staggered, grid: StaggeredGrid, numbers: Numbers) -> Volume:
    """Convective and viscous fluxes of component c through the boxes around its inner faces."""
    own = state.velocity[c]
    total = _difference(state.pressure, c) / grid.spacing[c]
    for axis in range(3):
        if axis == c:
            carried = carrier = _mean(_inner(own, _others(c)), c)
            slope = _difference(_inner(own, _others(c)), c)
        else:
            third = 3 - c - axis
            across = _inner(own, (c, third))
            carried, slope = _mean(across, axis), _difference(across, axis)
            carrier = _inner(_mean(state.velocity[axis], c), (c, third))
        flux = carried * carrier - slope / (grid.spacing[axis] * numbers.reynolds)
        total = total + _difference(flux, axis) / grid.spacing[axis]
    if c == 2:  # e_g = -z
        total = total - numbers.richardson * _mean(_inner(state.temperature, (0, 1, 2)), 2)
    return total


def _heat(state: Staggered, grid: StaggeredGrid, numbers: Numbers) -> Volume:
    total = jnp.zeros(grid.cells, state.temperature.dtype)
    for axis in range(3):
        across = _inner(state.temperature, _others(axis))
        carrier = _inner(state.velocity[axis], _others(axis))
        slope = _difference(across, axis) / grid.spacing[axis]
        flux = _mean(across, axis) * carrier - slope / numbers.peclet
        total = total + _difference(flux, axis) / grid.spacing[axis]
    return total


def _others(axis: int) -> tuple[int, int]:
    first, second = (a for a in range(3) if a != axis)
    return first, second


def _inner(values: Volume, axes: tuple[int, ...]) -> Volume:
    """Without the first and last layer along `axes`."""
    return values[tuple(slice(1, -1) if axis in axes else slice(None) for axis in range(3))]


def _pair(values: Volume, axis: int) -> tuple[Volume, Volume]:
    before = tuple(slice(None, -1) if a == axis else slice(None) for a in range(3))
    after = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
    return values[before], values[after]


def _mean(values: Volume, axis: int) -> Volume:
    before, after = _pair(values, axis)
    return 0.5 * (before + after)


def _difference(values: Volume, axis: int) -> Volume:
    before, after = _pair(values, axis)
    return after - before


def as_residuals(parts: tuple[Volume, tuple[Volume, Volume, Volume], Volume]) -> Residuals:
    """The same, flattened: momentum of all three components in one row."""
    mass, momentum, heat = parts
    return Residuals(
        mass=mass.reshape(-1),
        momentum=jnp.concatenate([m.reshape(-1) for m in momentum]),
        heat=heat.reshape(-1),
    )
