"""A result as an OpenFOAM case: `./Allrun` makes the mesh, and T, U and p are there at time 0, cell by cell.

Objects are cut out of the mesh (`blocks.py`), and each has a patch of its own with what the scene tells of its heat.
Cells are about as large as those between the result's vertices and hold the value at their middle, linear between
the vertices. blockMesh numbers them block by block, with x fastest. Wall values are those of the nearest cells
(zeroGradient), openings are part of their walls: look, do not restart from it.
"""

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.errors import BadInputError
from app.report.blocks import Blocks, cut_room
from app.report.patches import MeshPatch, patches_of, thermal_of
from core.air import Air
from core.objects import RoomObject, inside_objects
from core.result import Solution

# The corners of a block, and which of them each face has, in the order of `WALLS`.
_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
_FIELDS = {"T": "[0 0 0 1 0 0 0]", "p": "[0 2 -2 0 0 0 0]", "U": "[0 1 -1 0 0 0 0]"}
# What checkMesh and postProcess ask for; no equation is solved.
_SCHEMES = (
    "ddtSchemes { default steadyState; }\ngradSchemes { default Gauss linear; }\ndivSchemes { default none; }\n"
    "laplacianSchemes { default Gauss linear corrected; }\ninterpolationSchemes { default linear; }\n"
    "snGradSchemes { default corrected; }\n"
)
_ALLRUN = '#!/bin/sh\n# The mesh, and what it is like.\ncd "${0%/*}" || exit 1\nblockMesh && checkMesh\n'


def write_openfoam(
    path: Path, solution: Solution, objects: Sequence[RoomObject] = (), air: Air | None = None
) -> None:
    """Write the case as one zip file; `objects` are those that the result was made with, `air` that of its scene.

    Raises BadInputError where the result's air is not what these objects leave, and what `cut_room` raises.
    """
    _check_objects(solution, objects)
    blocks = cut_room((solution.x_m, solution.y_m, solution.z_m), objects)
    patches = patches_of(blocks, objects)
    plain = [f"    {patch.name} {{ type zeroGradient; }}" for patch in patches]
    fast = [f"    {patch.name} {{ type {'noSlip' if patch.item else 'zeroGradient'}; }}" for patch in patches]
    warm = [thermal_of(blocks, patch, air or Air()) for patch in patches]
    solution = solution.filled()

    def field(name: str, vertices: np.ndarray, boundary: Sequence[str]) -> str:
        return _field(name, _cells(vertices, solution, blocks), boundary)

    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as case:
        case.writestr(_executable("case/Allrun"), _ALLRUN, zipfile.ZIP_DEFLATED)
        case.writestr("case/system/blockMeshDict", _mesh(blocks, patches))
        case.writestr("case/system/controlDict", _control())
        case.writestr("case/system/fvSchemes", header("dictionary", "fvSchemes") + _SCHEMES)
        case.writestr("case/system/fvSolution", header("dictionary", "fvSolution"))
        case.writestr("case/0/T", field("T", solution.temperature_k[..., None], warm))
        if solution.velocity_m_s is not None:
            case.writestr("case/0/U", field("U", solution.velocity_m_s, fast))
        if solution.pressure_m2_s2 is not None:
            case.writestr("case/0/p", field("p", solution.pressure_m2_s2[..., None], plain))


def _check_objects(solution: Solution, objects: Sequence[RoomObject]) -> None:
    """Vertices at the objects' faces may be on either side; the others have air outside the objects alone."""
    axes = (solution.x_m, solution.y_m, solution.z_m)
    near, deep = (inside_objects(_grown(objects, by_m), axes) for by_m in (1e-3, -1e-3))
    if (~solution.air & ~near).any() or (solution.air & deep).any():
        raise BadInputError(
            "The result was made with other objects than experiment.toml tells now, so that its mesh is not known. "
            "Reconstruct again, or take the objects back."
        )


def _grown(objects: Sequence[RoomObject], by_m: float) -> list[RoomObject]:
    """The objects larger by a margin on every side; those of which nothing is left are left out."""
    boxes = [
        (
            item,
            tuple(low - by_m for low in item.lower_m),
            tuple(high + by_m for high in item.upper_m),
        )
        for item in objects
    ]
    return [
        RoomObject(name=item.name, lower_m=(low[0], low[1], low[2]), upper_m=(high[0], high[1], high[2]))
        for item, low, high in boxes
        if all(one < other for one, other in zip(low, high, strict=True))
    ]


def _executable(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)
    entry.external_attr = 0o100755 << 16
    return entry


def header(kind: str, name: str) -> str:
    """What each of OpenFOAM's files begins with."""
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n\n"


def _control() -> str:
    return header("dictionary", "controlDict") + (
        "application none;\nstartFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 0;\n"
        "deltaT 1;\nwriteControl timeStep;\nwriteInterval 1;\nwritePrecision 9;\n"
    )


def _mesh(blocks: Blocks, patches: Sequence[MeshPatch]) -> str:
    """Only corners of blocks that hold air are vertices."""
    corners = {block: [_added(block, corner) for corner in _CORNERS] for block in blocks.air}
    used = sorted({one for eight in corners.values() for one in eight}, key=lambda one: one[::-1])
    index = {one: number for number, one in enumerate(used)}
    vertices = "\n".join(
        "    ({:.9g} {:.9g} {:.9g})".format(*(blocks.planes_m[a][one[a]] for a in range(3))) for one in used
    )

    def numbers(block: tuple[int, int, int], which: Sequence[int]) -> str:
        return " ".join(str(index[corners[block][one]]) for one in which)

    hexes = "\n".join(
        f"    hex ({numbers(block, range(8))}) ({_counts(blocks, block)}) simpleGrading (1 1 1)"
        for block in blocks.air
    )
    boundary = "\n".join(
        f"    {patch.name}\n    {{\n        type wall;\n        faces\n        (\n"
        + "\n".join(f"            ({numbers(side.block, FACES[side.number])})" for side in patch.sides)
        + "\n        );\n    }"
        for patch in patches
    )
    return header("dictionary", "blockMeshDict") + (
        f"scale 1;\nvertices\n(\n{vertices}\n);\nblocks\n(\n{hexes}\n);\nboundary\n(\n{boundary}\n);\n"
    )


def _added(block: tuple[int, int, int], corner: tuple[int, int, int]) -> tuple[int, int, int]:
    return block[0] + corner[0], block[1] + corner[1], block[2] + corner[2]


def _counts(blocks: Blocks, block: tuple[int, int, int]) -> str:
    return " ".join(str(counts[i]) for counts, i in zip(blocks.cells, block, strict=True))


def _field(name: str, rows: Float[np.ndarray, "cells parts"], boundary: Sequence[str]) -> str:
    vector = rows.shape[1] == 3
    words = [f"({a:.7g} {b:.7g} {c:.7g})" for a, b, c in rows] if vector else [f"{v:.7g}" for v in rows[:, 0]]
    kind = "vector" if vector else "scalar"
    return header(f"vol{kind.capitalize()}Field", name) + (
        f"dimensions {_FIELDS[name]};\ninternalField nonuniform List<{kind}>\n{len(words)}\n(\n"
        + "\n".join(words)
        + "\n);\nboundaryField\n{\n"
        + "\n".join(boundary)
        + "\n}\n"
    )


def _cells(
    vertices: Float[np.ndarray, "nx ny nz parts"], solution: Solution, blocks: Blocks
) -> Float[np.ndarray, "cells parts"]:
    """The values at the middles of the air's cells, in blockMesh's order."""
    values = np.asarray(vertices, np.float64)
    for axis, axis_m in enumerate((solution.x_m, solution.y_m, solution.z_m)):
        values = _between(values, axis, axis_m, blocks.centres_m(axis))
    # Transposed, a block's cells have x fastest.
    parts = [values[blocks.cells_of(block)].transpose(2, 1, 0, 3) for block in blocks.air]
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])


def _between(values: np.ndarray, axis: int, axis_m: np.ndarray, at_m: np.ndarray) -> np.ndarray:
    """Linear between the vertices of one axis."""
    place = np.interp(at_m, axis_m, np.arange(len(axis_m)))
    low = np.minimum(place.astype(int), len(axis_m) - 2)
    share = (place - low).reshape([-1 if one == axis else 1 for one in range(values.ndim)])
    return (1.0 - share) * values.take(low, axis) + share * values.take(low + 1, axis)
