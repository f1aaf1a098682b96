"""From cells to the room's vertices: linear between cell centres, with the walls' values on the walls.

In NumPy: it is done once a march, and compiling it would take as long as a hundred marches' vertices.
"""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from core.room.room_grid import AXES, RoomGrid, Velocity
from core.room.step import Flow, RoomModel
from core.room.wall_planes import WallPlane

Vertices = Float[np.ndarray, "vx vy vz"]
Field = Float[np.ndarray, "..."]


class RoomFields(eqx.Module):
    """A room on its vertices; `outflow_excess_k` is the mean of the air that leaves by each of its outlets."""

    excess_k: Float[np.ndarray, "vx vy vz"]
    pressure_m2_s2: Float[np.ndarray, "vx vy vz"]
    velocity_m_s: Float[np.ndarray, "vx vy vz 3"]
    outflow_excess_k: Float[np.ndarray, " outlets"]


def vertex_excess_k(flow: Flow, model: RoomModel, vertices: tuple[int, int, int]) -> Vertices:
    """Excess temperature: on inlets the supply's, on walls and heaters their own, else that of the next air.

    The layer between a wall and the air bends every ray that crosses it at a slant: of the signal of a camera that
    looks into a room through a wall of glass from 4 m, most.
    """

    def value(wall: WallPlane, cell: Field, inward: float) -> Field:
        share = np.where(wall.conductance_m_s > 0, wall.held, 0.0)
        held = share * wall.wall_excess_k + (1.0 - share) * cell
        return np.where(inward * wall.normal_m_s > 0, wall.inflow_excess_k, held)

    cells, walls = jax.device_get((flow.excess_k, model.boundary.walls))
    planes = [
        (value(low, first, 1.0), value(high, last, -1.0))
        for (low, high), (first, last) in zip(walls, _end_planes(cells), strict=True)
    ]
    return _to_vertices(_extended(cells, planes), model.grid, vertices)


def vertex_pressure_m2_s2(flow: Flow, model: RoomModel, vertices: tuple[int, int, int]) -> Vertices:
    """Kinematic pressure minus its mean over the outlets (over the room where there is none)."""
    cells, walls = jax.device_get((flow.pressure_m2_s2, model.boundary.walls))
    planes = _end_planes(cells)
    # The hydrostatic part is linear in z up to the wall.
    planes[2] = (1.5 * cells[:, :, 0] - 0.5 * cells[:, :, 1], 1.5 * cells[:, :, -1] - 0.5 * cells[:, :, -2])
    total = area = 0.0
    for pair, both in zip(walls, planes, strict=True):
        for inward, wall, plane in zip((1.0, -1.0), pair, both, strict=True):
            out = np.maximum(-inward * wall.normal_m_s, 0.0)
            total, area = total + float(np.sum(out * plane)), area + float(np.sum(out))
    gauge = total / area if area > 0 else float(cells.mean())
    return _to_vertices(
        _extended(cells - gauge, [(p - gauge, q - gauge) for p, q in planes]), model.grid, vertices
    )


def vertex_velocity_m_s(
    velocity: Velocity, model: RoomModel, vertices: tuple[int, int, int]
) -> Float[np.ndarray, "vx vy vz 3"]:
    """Velocity; zero on no-slip walls except in openings."""
    inner, walls = jax.device_get((velocity, model.boundary.walls))
    components = []
    for a in AXES:
        component = inner[a]
        for b in AXES:
            if b != a:
                component = _close(component, walls[b], a, b)
        components.append(_to_vertices(component, model.grid, vertices, faces=a))
    return np.stack(components, -1)


def cell_matrix(
    grid: RoomGrid, axis: int, vertices: int, *, faces: bool = False
) -> Float[np.ndarray, "vertices nodes"]:
    """Linear interpolation from [wall, centres, wall] (or the faces) to equidistant vertices."""
    centres = np.concatenate([grid.faces_m(axis)[:1], grid.centres_m(axis), grid.faces_m(axis)[-1:]])
    nodes = grid.faces_m(axis) if faces else centres
    return linear_matrix(nodes, np.linspace(nodes[0], nodes[-1], vertices))


def linear_matrix(
    nodes: Float[np.ndarray, " nodes"], points: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "points nodes"]:
    """Matrix of linear interpolation from nodes to points; constant beyond the ends."""
    index = np.clip(np.searchsorted(nodes, points) - 1, 0, len(nodes) - 2)
    share = np.clip((points - nodes[index]) / (nodes[index + 1] - nodes[index]), 0.0, 1.0)
    matrix = np.zeros((len(points), len(nodes)))
    rows = np.arange(len(points))
    matrix[rows, index] = 1.0 - share
    matrix[rows, index + 1] += share
    return matrix


def interpolated(matrix: Float[np.ndarray, "points nodes"], field: Field, axis: int) -> Field:
    """A field on the points of one axis instead of its nodes."""
    return np.moveaxis(np.tensordot(matrix, field, axes=(1, axis)), 0, axis)


def _end_planes(cells: Field) -> list[tuple[Field, Field]]:
    """The cells beside the two walls of each axis."""
    return [(cells.take(0, a), cells.take(-1, a)) for a in AXES]


def _extended(cells: Field, planes: list[tuple[Field, Field]]) -> Field:
    """Cells with the walls' values around them; an edge has the mean of its two walls."""
    field = np.pad(cells, 1, mode="edge")
    for a in AXES:
        for end, plane in zip((0, -1), planes[a], strict=True):
            field[tuple(end if b == a else slice(1, -1) for b in AXES)] = plane
    for a in AXES:
        b, c = (other for other in AXES if other != a)
        for i, i1 in ((0, 1), (-1, -2)):
            for j, j1 in ((0, 1), (-1, -2)):
                one, two = _line(a, b, c, i1, j), _line(a, b, c, i, j1)
                field[_line(a, b, c, i, j)] = 0.5 * (field[one] + field[two])
    return field


def _line(a: int, b: int, c: int, i: int, j: int) -> tuple[slice | int, ...]:
    index: list[slice | int] = [slice(None)] * 3
    index[b], index[c] = i, j
    return tuple(index)


def _close(component: Field, walls: tuple[WallPlane, WallPlane], a: int, b: int) -> Field:
    """Component a with its values on the two walls of axis b."""
    first, _ = (c for c in AXES if c != b)
    axis = 0 if a == first else 1
    planes = []
    for wall, cell in zip(walls, (component.take(0, b), component.take(-1, b)), strict=True):
        # Onto a's faces, each between two cells: the end faces repeat their cell.
        below, above = (
            np.pad(wall.tangent_m_s[axis], [ends if d == axis else (0, 0) for d in (0, 1)], mode="edge")
            for ends in ((1, 0), (0, 1))
        )
        on_faces = 0.5 * (below + above)
        # An axis whose walls were added before has two more planes.
        grown = [((n - m) // 2,) * 2 for n, m in zip(cell.shape, on_faces.shape, strict=True)]
        planes.append(wall.no_slip * np.pad(on_faces, grown, mode="edge") + (1.0 - wall.no_slip) * cell)
    return np.concatenate([np.expand_dims(planes[0], b), component, np.expand_dims(planes[1], b)], b)


def _to_vertices(
    field: Field, grid: RoomGrid, vertices: tuple[int, int, int], *, faces: int | None = None
) -> Vertices:
    for a in AXES:
        matrix = cell_matrix(grid, a, vertices[a], faces=faces == a).astype(np.float32)
        field = interpolated(matrix, field, a)
    return field
