"""A result as an OpenFOAM case: `blockMesh`, then T, U and p are there at time 0, cell by cell.

Cells lie between the result's vertices and hold the mean of their eight corners; blockMesh numbers them
with x fastest. Wall values are those of the nearest cells (zeroGradient): look, do not restart from it.
"""

import zipfile
from pathlib import Path

import numpy as np
from jaxtyping import Float

from core.geometry import WALLS
from core.result import Solution

# In the order of `WALLS`.
_FACES = ("(0 4 7 3)", "(1 2 6 5)", "(0 1 5 4)", "(3 7 6 2)", "(0 3 2 1)", "(4 5 6 7)")
_FIELDS = {"T": "[0 0 0 1 0 0 0]", "p": "[0 2 -2 0 0 0 0]", "U": "[0 1 -1 0 0 0 0]"}


def write_openfoam(path: Path, solution: Solution) -> None:
    """Write the case as one zip file; cells of objects hold the nearest air's values, at rest."""
    solution = solution.filled()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as case:
        case.writestr("case/system/blockMeshDict", _mesh(solution))
        case.writestr("case/system/controlDict", _control())
        case.writestr("case/system/fvSchemes", _header("dictionary", "fvSchemes"))
        case.writestr("case/system/fvSolution", _header("dictionary", "fvSolution"))
        case.writestr("case/0/T", _field("T", solution.temperature_k[..., None]))
        if solution.velocity_m_s is not None:
            case.writestr("case/0/U", _field("U", solution.velocity_m_s))
        if solution.pressure_m2_s2 is not None:
            case.writestr("case/0/p", _field("p", solution.pressure_m2_s2[..., None]))


def _header(kind: str, name: str) -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n\n"


def _control() -> str:
    return _header("dictionary", "controlDict") + (
        "application none;\nstartFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 0;\n"
        "deltaT 1;\nwriteControl timeStep;\nwriteInterval 1;\n"
    )


def _mesh(solution: Solution) -> str:
    axes = (solution.x_m, solution.y_m, solution.z_m)
    (x0, x1), (y0, y1), (z0, z1) = ((float(axis[0]), float(axis[-1])) for axis in axes)
    corners = [(x, y, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    vertices = "\n".join(f"    ({x:g} {y:g} {z:g})" for x, y, z in corners)
    counts = " ".join(str(len(axis) - 1) for axis in axes)
    patches = "\n".join(
        f"    {name} {{ type wall; faces ({face}); }}" for name, face in zip(WALLS, _FACES, strict=True)
    )
    return _header("dictionary", "blockMeshDict") + (
        f"scale 1;\nvertices\n(\n{vertices}\n);\nblocks (hex (0 1 2 3 4 5 6 7) ({counts}) "
        f"simpleGrading (1 1 1));\nboundary\n(\n{patches}\n);\n"
    )


def _field(name: str, vertices: Float[np.ndarray, "nx ny nz parts"]) -> str:
    cells = _cells(np.asarray(vertices, np.float64))
    # Fortran order of [ix, iy, iz]: x fastest.
    rows = np.stack([cells[..., part].ravel(order="F") for part in range(cells.shape[-1])], axis=1)
    vector = rows.shape[1] == 3
    words = [f"({a:.7g} {b:.7g} {c:.7g})" for a, b, c in rows] if vector else [f"{v:.7g}" for v in rows[:, 0]]
    kind = "vector" if vector else "scalar"
    walls = "\n".join(f"    {wall} {{ type zeroGradient; }}" for wall in WALLS)
    return _header(f"vol{kind.capitalize()}Field", name) + (
        f"dimensions {_FIELDS[name]};\ninternalField nonuniform List<{kind}>\n{len(words)}\n(\n"
        + "\n".join(words)
        + f"\n);\nboundaryField\n{{\n{walls}\n}}\n"
    )


def _cells(vertices: Float[np.ndarray, "nx ny nz parts"]) -> Float[np.ndarray, "cx cy cz parts"]:
    """The mean of each cell's eight corners."""
    for axis in range(3):
        low = [slice(None)] * 4
        high = [slice(None)] * 4
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        vertices = 0.5 * (vertices[tuple(low)] + vertices[tuple(high)])
    return vertices
