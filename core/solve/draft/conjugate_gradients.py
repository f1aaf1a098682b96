"""Preconditioned conjugate gradients on small vectors: a second thread would cost more than it takes over.

The BLAS splits a scalar product of some ten thousand numbers between threads that then wait for each other: on a
busy machine that was five sixths of a draft. Source: Hestenes & Stiefel (1952); Saad, Iterative Methods, 9.2.1.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

Volume = Float[np.ndarray, "nx ny nz"]
Product = Callable[[Volume], Volume]


def conjugate_gradients(
    product: Product,
    inverse: Product,
    rhs: Volume,
    tolerance: float,
    max_iterations: int,
    record: Callable[[Volume], object] = lambda found: None,
    start: Volume | None = None,
) -> tuple[Volume, bool]:
    """x of `product(x) = rhs`, and whether its residual is below `tolerance` times that of zero.

    `product` is symmetric and positive, `inverse` roughly its inverse; `record` hears of x after each iteration.
    `start` is a first guess: it saves iterations, and the residual's limit is the same.
    """
    found = np.zeros_like(rhs) if start is None else start.copy()
    left = rhs.copy() if start is None else rhs - product(start)
    limit = tolerance * _dot(rhs, rhs) ** 0.5
    direction, before = np.zeros_like(rhs), 1.0
    for _ in range(max_iterations):
        if _dot(left, left) ** 0.5 <= limit:
            return found, True
        better = inverse(left)
        now = _dot(left, better)
        direction = better + (now / before) * direction
        steep = product(direction)
        step = now / _dot(direction, steep)
        found += step * direction
        left -= step * steep
        before = now
        record(found)
    return found, _dot(left, left) ** 0.5 <= limit


def _dot(one: Volume, other: Volume) -> float:
    """Without the BLAS, hence in this thread."""
    return float(np.einsum("i,i->", one.ravel(), other.ravel()))
