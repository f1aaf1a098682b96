"""The surface of one temperature as a mesh, for programs that draw solids."""

from pathlib import Path

import numpy as np
from skimage.measure import marching_cubes

from app.errors import BadInputError
from core.result import Solution


def write_ply(path: Path, solution: Solution, level_k: float | None = None) -> None:
    """Write the surface T = `level_k` as a binary PLY of triangles [m].

    Without a level, half-way between the room's mean and what departs from it most. Raises BadInputError where
    the room holds no such temperature.
    """
    temperature_k = np.asarray(solution.filled().temperature_k, np.float32)
    level_k = middle_level_k(temperature_k) if level_k is None else level_k
    low_k, high_k = float(temperature_k.min()), float(temperature_k.max())
    if not low_k < level_k < high_k:
        raise BadInputError(
            f"The level is {level_k:g} K; the result holds {low_k:.2f} to {high_k:.2f} K. Give one between."
        )
    axes = (solution.x_m, solution.y_m, solution.z_m)
    spacing_m = tuple(float((axis[-1] - axis[0]) / (len(axis) - 1)) for axis in axes)
    vertices, faces, _, _ = marching_cubes(temperature_k, level_k, spacing=spacing_m)
    vertices_m = vertices + np.array([axis[0] for axis in axes], np.float32)
    path.write_bytes(_ply(vertices_m.astype("<f4"), faces.astype("<i4"), level_k))


def middle_level_k(temperature_k: np.ndarray) -> float:
    """Half-way between the mean and the value that departs from it most."""
    mean_k = float(temperature_k.mean(dtype=np.float64))
    farthest_k = max(float(temperature_k.min()), float(temperature_k.max()), key=lambda k: abs(k - mean_k))
    return 0.5 * (mean_k + farthest_k)


def _ply(vertices_m: np.ndarray, faces: np.ndarray, level_k: float) -> bytes:
    head = "\n".join(
        (
            "ply",
            "format binary_little_endian 1.0",
            f"comment airlens: surface of T = {level_k:.3f} K, metres",
            f"element vertex {len(vertices_m)}",
            *(f"property float {axis}" for axis in "xyz"),
            f"element face {len(faces)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        )
    )
    rows = np.empty(len(faces), dtype=[("corners", "u1"), ("vertices", "<i4", 3)])
    rows["corners"], rows["vertices"] = 3, faces
    return head.encode("ascii") + vertices_m.tobytes() + rows.tobytes()
