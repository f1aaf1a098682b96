"""The paper's triangular pixel filter as points and weights on the sensor.

    I_j = int f_j(s) L(s) ds,    f_j(s) = (1 - |s_x - j_x|) (1 - |s_y - j_y|) within one pixel of j

Two independent samples a pixel are noise worth half a pixel of shift, a thousand times the signal: so the
points are either fixed (quadrature) or drawn from a seed and a pixel's own number (common random numbers).
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


def quadrature(samples: int) -> tuple[Float[np.ndarray, "samples 2"], Float[np.ndarray, " samples"]]:
    """Gauss points of the filter: offsets (column, row) [px] and weights that sum to 1.

    `samples` is rounded up to a square n^2; exact for polynomials of degree 2 n - 1 on each axis.
    """
    nodes, weights = _gauss_tent(max(1, int(np.ceil(np.sqrt(samples)))))
    column, row = np.meshgrid(nodes, nodes)
    return np.stack([column.ravel(), row.ravel()], axis=1), np.outer(weights, weights).ravel()


def monte_carlo(
    seed: int, pixel_numbers: Int[Array, " pixels"], samples: int
) -> Float[Array, "samples pixels 2"]:
    """Random offsets [px] with the filter's density; equal weights.

    The same seed and pixel number give the same points in the reference, the flow image and a prediction,
    however an image is cut into batches.
    """

    def draw(number: Array) -> Array:
        uniform = jax.random.uniform(jax.random.fold_in(jax.random.key(seed), number), (samples, 2, 2))
        # The sum of two uniforms has the tent's density.
        return uniform.sum(-1) - 1.0

    return jnp.moveaxis(jax.vmap(draw)(pixel_numbers), 0, 1)


def lens_disc(diameter_m: float) -> Float[np.ndarray, "points 2"]:
    """Four points of equal weight on a lens's aperture: exact for polynomials of degree 3 over the disc."""
    reach = diameter_m / 2 / np.sqrt(2.0)
    return reach * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def _gauss_tent(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss quadrature of the weight 1 - |s| on [-1, 1] (Golub & Welsch 1969, discretised Stieltjes)."""
    fine, fine_weights = np.polynomial.legendre.leggauss(64)
    s = np.concatenate([(fine - 1) / 2, (fine + 1) / 2])
    mass = np.tile(fine_weights / 2, 2) * (1 - np.abs(s))
    previous, current, norm, beta = np.zeros_like(s), np.ones_like(s), 1.0, []
    for _ in range(count - 1):
        # The weight is even: the recurrence has no diagonal.
        following = s * current - (beta[-1] if beta else 0.0) * previous
        following_norm = float(mass @ following**2)
        beta.append(following_norm / norm)
        previous, current, norm = current, following, following_norm
    off = np.sqrt(beta)
    values, vectors = np.linalg.eigh(np.diag(off, 1) + np.diag(off, -1)) if beta else (np.zeros(1), np.eye(1))
    return values, vectors[0] ** 2
