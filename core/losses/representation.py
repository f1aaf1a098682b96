"""The protocol between losses and representations of (T, p, u), and the unknowns of a solve.

A representation does not know the losses, and a loss does not know the representation.
"""

from typing import Protocol, runtime_checkable

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from core.losses.boussinesq import FlowValues, Numbers, Residuals

Span = tuple[float, float, int]
Spans = tuple[Span, Span, Span]


@runtime_checkable
class Fields(Protocol):
    """T, p, u in nondimensional coordinates, evaluated."""

    def at(self, points_nd: Float[Array, "points 3"]) -> FlowValues:
        """Values at scattered points."""
        ...

    def on_grid(self, spans: Spans) -> FlowValues:
        """Values on a tensor grid of points: first, last and number along x, y, z."""
        ...

    def residuals(self, numbers: Numbers, points_nd: Float[Array, "points 3"] | None) -> Residuals:
        """What the equations leave: at the points, or of every cell for a grid, which ignores them."""
        ...


@runtime_checkable
class Representation(Protocol):
    """Parameters that give fields."""

    def fields(self) -> Fields:
        """The fields of these parameters; what several losses need is computed here once."""
        ...


class Unknowns(eqx.Module):
    """All unknowns of a solve: a representation, and what the scene leaves open besides.

    `drift`: a motion of each view's picture (camera and projector together; they are the same six numbers to first
    order when the wall is seen face-on), in the units of the losses' `motions`.
    None where the camera cannot have moved.
    """

    representation: Representation
    drift: Float[Array, "views 6"] | None = None


def positions(span: Span) -> Float[np.ndarray, " n"]:
    """The coordinates of a span."""
    return np.linspace(*span)


def points_of(spans: Spans) -> Float[np.ndarray, "points 3"]:
    """All points of a tensor grid, x slowest."""
    mesh = np.meshgrid(*(positions(span) for span in spans), indexing="ij")
    return np.stack([m.ravel() for m in mesh], axis=1)
