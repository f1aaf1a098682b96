"""Airs that a result allows: its T and u, each moved by a smooth random field of its own deviation.

    sample = found + shared w + rest x g,      corr(g(x), g(y)) = exp(-|x - y|^2 / (2 length^2))

A result keeps one standard deviation a vertex, and of how the errors of two places go together only those that the
whole field shares, if any (w: their sizes, of unit variance). For the rest of the deviation `length` is taken. The
interval of a mean over many places is narrow for a short length and wide for a long one; that of one place is the
same for any. Components and temperature are taken as independent.
What is shut in the found flow is shut in every sample.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from core.result import Solution

Field = Float[np.ndarray, "nx ny nz"]


def samples(solution: Solution, count: int, length_m: float, seed: int = 0) -> Iterator[Solution]:
    """`count` airs; a quantity without a deviation is the found one in all of them."""
    rng = np.random.default_rng(seed)
    axes = (solution.x_m, solution.y_m, solution.z_m)
    roots = tuple(_root(np.asarray(axis, np.float64), length_m) for axis in axes)
    for _ in range(count):
        temperature_k, velocity_m_s = solution.temperature_k, solution.velocity_m_s
        if solution.temperature_std_k is not None:
            temperature_k = temperature_k + _error_k(solution, rng, roots)
        if velocity_m_s is not None and solution.velocity_std_m_s is not None:
            moved = np.stack([_smooth(rng, roots) for _ in range(3)], axis=-1)
            velocity_m_s = velocity_m_s + solution.velocity_std_m_s * _shut(velocity_m_s, moved)
        yield replace(solution, temperature_k=temperature_k, velocity_m_s=velocity_m_s)


def _error_k(solution: Solution, rng: np.random.Generator, roots: tuple[np.ndarray, ...]) -> Field:
    """An error of T that the result allows."""
    std_k, shared_k = np.asarray(solution.temperature_std_k), solution.temperature_shared_k
    if shared_k is None:
        return std_k * _smooth(rng, roots)
    rest_k = np.sqrt(np.maximum(std_k**2 - np.sum(shared_k**2, axis=-1), 0.0))
    return shared_k @ rng.standard_normal(shared_k.shape[-1]) + rest_k * _smooth(rng, roots)


def _shut(velocity_m_s: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """The change, none of it through a wall where the found air passes none."""
    for a in range(3):
        for end in (0, -1):
            plane = (*(end if b == a else slice(None) for b in range(3)), a)
            moved[plane] *= velocity_m_s[plane] != 0
    return moved


def _smooth(rng: np.random.Generator, roots: tuple[np.ndarray, ...]) -> Field:
    """A random field of unit variance everywhere: the correlation is a product over the axes, and so is its root."""
    field = rng.standard_normal(tuple(root.shape[1] for root in roots), dtype=np.float32)
    for root in roots:  # each takes the first axis and puts its own last
        field = np.tensordot(field, root, axes=(0, 1))
    return field


def _root(axis_m: np.ndarray, length_m: float) -> Float[np.ndarray, "nodes modes"]:
    """Modes of the correlation along an axis; a smooth field has few."""
    values, modes = np.linalg.eigh(np.exp(-0.5 * ((axis_m[:, None] - axis_m) / length_m) ** 2))
    kept = values > 1e-5 * values[-1]
    root = modes[:, kept] * np.sqrt(values[kept])
    return (root / np.linalg.norm(root, axis=1, keepdims=True)).astype(np.float32)
