"""A room without objects as a case for OpenFOAM's steady solver of buoyant air, from rest; its fields read back."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from app.errors import BadInputError
from app.report.openfoam import FACES, header
from core.air import GRAVITY_M_S2
from core.geometry import WALLS, WallName, face_of
from core.known import stated_walls
from core.room.k_epsilon import C_MU, TURBULENT_PRANDTL
from core.room.openings import supply_turbulence
from core.scene import Heater, Inlet, Outlet, Scene

SOLVER = "buoyantBoussinesqSimpleFoam"
Turbulence = Literal["kEpsilon", "RNGkEpsilon", "kOmegaSST"]
Part = Inlet | Outlet | Heater
_EVERY_WALL, _CALCULATED = f'"({"|".join(WALLS)}|heater.*)"', "type calculated; value uniform 0;"
_SCHEMES = """ddtSchemes { default steadyState; }
gradSchemes { default Gauss linear; grad(U) cellLimited Gauss linear 1; grad(T) cellLimited Gauss linear 1; }
divSchemes
{
    default none;
    div(phi,U) bounded Gauss linearUpwind grad(U);
    div(phi,T) bounded Gauss linearUpwind grad(T);
    div(phi,k) bounded Gauss upwind;
    div(phi,epsilon) bounded Gauss upwind;
    div(phi,omega) bounded Gauss upwind;
    div((nuEff*dev2(T(grad(U))))) Gauss linear;
}
laplacianSchemes { default Gauss linear orthogonal; }
interpolationSchemes { default linear; }
snGradSchemes { default orthogonal; }
wallDist { method meshWave; }
"""
_SOLUTION = """solvers
{
    p_rgh { solver GAMG; smoother GaussSeidel; tolerance 1e-9; relTol 0.02; }
    "(U|T|k|epsilon|omega)" { solver PBiCGStab; preconditioner DILU; tolerance 1e-10; relTol 0.05; }
}
SIMPLE { nNonOrthogonalCorrectors 0; }
relaxationFactors { fields { p_rgh 0.7; } equations { U 0.3; T 0.7; "(k|epsilon|omega)" 0.4; } }
"""


def write_case(
    case: Path,
    scene: Scene,
    cells: tuple[int, int, int],
    every: int,
    most: int,
    turbulence: Turbulence = "kEpsilon",
    mean_from: int | None = None,
) -> None:
    """The room as a case that starts from still air, written out after so many iterations, and that many in all.

    With `mean_from`, means of U, T and p_rgh over the later iterations are written as well: a room that does not
    settle wanders about its mean. Raises BadInputError for objects, heaters off the floor and walls of unknown heat.
    """
    heaters = [part for part in scene.boundary if isinstance(part, Heater)]
    if scene.objects or any(part.patch.wall != "z_min" for part in heaters):
        raise BadInputError(
            "This room has objects, or heaters on other walls than the floor, which the case for OpenFOAM does not "
            "hold. Take a room without."
        )
    parts = {
        f"opening{n}": part
        for n, part in enumerate(part for part in scene.boundary if isinstance(part, Inlet | Outlet))
    } | {f"heater{n}": part for n, part in enumerate(heaters)}
    patches = "".join(
        f"    {{ name {name}; patchInfo {{ type {'wall' if isinstance(part, Heater) else 'patch'}; }} "
        f"constructFrom set; set {name}; }}\n"
        for name, part in parts.items()
    )
    texts = {
        "constant/transportProperties": _transport(scene),
        "constant/turbulenceProperties": (
            f"simulationType RAS;\nRAS {{ RASModel {turbulence}; turbulence on; }}\n"
        ),
        "system/controlDict": _control(every, most, mean_from),
        "system/fvSchemes": _SCHEMES,
        "system/fvSolution": _SOLUTION,
        "system/blockMeshDict": _block(scene, cells),
        "system/topoSetDict": _sets(scene, parts),
        "system/createPatchDict": f"pointSync false;\npatches\n(\n{patches});\n",
    }
    for folder in ("0", "constant", "system"):
        (case / folder).mkdir()
    for path, text in texts.items():
        (case / path).write_text(header("dictionary", Path(path).name) + text)
    gravity = f"dimensions [0 1 -2 0 0 0 0];\nvalue (0 0 -{GRAVITY_M_S2:.9g});\n"
    (case / "constant/g").write_text(header("uniformDimensionedVectorField", "g") + gravity)
    for name, (dimensions, inside, boundary) in _fields(scene, parts).items():
        (case / "0" / name).write_text(
            header("volVectorField" if name == "U" else "volScalarField", name)
            + f"dimensions {dimensions};\ninternalField uniform {inside};\nboundaryField\n{{\n"
            + "".join(f"    {patch} {{ {told} }}\n" for patch, told in boundary.items())
            + "}\n"
        )


def read_field(path: Path, cells: tuple[int, int, int]) -> Float[np.ndarray, "nx ny nz parts"]:
    """A field that the case wrote: blockMesh numbers its cells with x fastest."""
    text = path.read_text()
    inside = text[text.index("internalField") : text.index("boundaryField")]
    numbers = inside[inside.index("\n(") :].translate(str.maketrans("();", "   ")).split()
    return np.array(numbers, float).reshape(*cells[::-1], -1).transpose(2, 1, 0, 3)


def _control(every: int, most: int, mean_from: int | None) -> str:
    text = (
        f"application {SOLVER};\nstartFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime {most};\n"
        f"deltaT 1;\nwriteControl timeStep;\nwriteInterval {every};\nwritePrecision 7;\n"
    )
    if mean_from is None:
        return text
    fields = " ".join(
        f"{name} {{ mean on; prime2Mean off; base time; }}" for name in ("U", "T", "p_rgh", "nut")
    )
    return text + (
        f'functions {{ means {{ type fieldAverage; libs ("libfieldFunctionObjects.so"); timeStart {mean_from}; '
        f"writeControl writeTime; fields ( {fields} ); }} }}\n"
    )


def _fields(scene: Scene, parts: dict[str, Part]) -> dict[str, tuple[str, str, dict[str, str]]]:
    """Dimensions, value inside and boundary of every field at rest."""
    return _flow(scene, parts) | _turbulence(parts)


def _flow(scene: Scene, parts: dict[str, Part]) -> dict[str, tuple[str, str, dict[str, str]]]:
    ambient_k = f"{scene.air.ambient_temperature_k:.7g}"
    pushed = "type fixedFluxPressure; rho rhok; value uniform 0;"
    velocity = _on(
        parts,
        lambda part: _fixed("({:.7g} {:.7g} {:.7g})".format(*part.velocity_m_s)),
        "type pressureInletOutletVelocity; value uniform (0 0 0);",
    )
    warm = _on(parts, lambda part: _fixed(f"{part.temperature_k:.7g}"), _leaving(ambient_k))
    warm |= {
        name: _fixed(f"{part.temperature_k:.7g}") for name, part in parts.items() if isinstance(part, Heater)
    }
    return {
        "U": ("[0 1 -1 0 0 0 0]", "(0 0 0)", {_EVERY_WALL: "type noSlip;"} | velocity),
        "T": ("[0 0 0 1 0 0 0]", ambient_k, {name: _wall_heat(scene, name) for name in WALLS} | warm),
        "p": ("[0 2 -2 0 0 0 0]", "0", {'".*"': _CALCULATED}),
        "p_rgh": (
            "[0 2 -2 0 0 0 0]",
            "0",
            {_EVERY_WALL: pushed} | _on(parts, lambda part: pushed, _fixed("0")),
        ),
    }


def _turbulence(parts: dict[str, Part]) -> dict[str, tuple[str, str, dict[str, str]]]:
    """The fields of every model of turbulence: a solver reads those of its own."""

    def supplied(value: Callable[[float, float], float], at_rest: str) -> dict[str, str]:
        def fixed(part: Inlet) -> str:
            return _fixed(f"{value(*supply_turbulence(part)):.7g}")

        return _on(parts, fixed, _leaving(at_rest))

    def on_walls(kind: str, value: str = "0", more: str = "") -> dict[str, str]:
        return {_EVERY_WALL: f"type {kind};{more} value uniform {value};"}

    follows = _on(parts, lambda part: _CALCULATED, _CALCULATED)
    heat = on_walls("alphatJayatillekeWallFunction", more=f" Prt {TURBULENT_PRANDTL};")
    k = ("0.001", on_walls("kqRWallFunction", "0.001") | supplied(lambda k, _: k, "0.001"))
    epsilon = ("0.0005", on_walls("epsilonWallFunction", "0.0005") | supplied(lambda _, e: e, "0.0005"))
    # The same eddies at rest and in the supplies: omega = epsilon / (C_mu k).
    omega = (
        "5.5",
        on_walls("omegaWallFunction", "5.5") | supplied(lambda k, e: e / (C_MU * k), "5.5"),
    )
    return {
        "k": ("[0 2 -2 0 0 0 0]", *k),
        "epsilon": ("[0 2 -3 0 0 0 0]", *epsilon),
        "omega": ("[0 0 -1 0 0 0 0]", *omega),
        "nut": ("[0 2 -1 0 0 0 0]", "0", on_walls("nutkWallFunction") | follows),
        "alphat": ("[0 2 -1 0 0 0 0]", "0", heat | follows),
    }


def _on(parts: dict[str, Part], on_inlet: Callable[[Inlet], str], on_outlet: str) -> dict[str, str]:
    """What each opening states; heaters are walls."""
    return {
        name: on_inlet(part) if isinstance(part, Inlet) else on_outlet
        for name, part in parts.items()
        if not isinstance(part, Heater)
    }


def _fixed(value: str) -> str:
    return f"type fixedValue; value uniform {value};"


def _leaving(value: str) -> str:
    return f"type inletOutlet; inletValue uniform {value}; value uniform {value};"


def _wall_heat(scene: Scene, name: WallName) -> str:
    wall = stated_walls(scene)[name]
    if wall is None or wall.thermal == "unknown":
        raise BadInputError(f"The heat through {name} is not known: take a room whose walls are all stated.")
    if wall.thermal == "adiabatic" or wall.temperature_k is None:
        return "type zeroGradient;"
    return _fixed(f"{wall.temperature_k:.7g}")


def _transport(scene: Scene) -> str:
    air = scene.air
    return (
        f"transportModel Newtonian;\nnu [0 2 -1 0 0 0 0] {air.kinematic_viscosity_m2_s:.9g};\n"
        f"beta [0 0 0 -1 0 0 0] {air.expansion_per_k:.9g};\nTRef [0 0 0 1 0 0 0] {air.ambient_temperature_k:.9g};\n"
        f"Pr [0 0 0 0 0 0 0] {air.prandtl:.9g};\nPrt [0 0 0 0 0 0 0] {TURBULENT_PRANDTL};\n"
    )


def _block(scene: Scene, cells: tuple[int, int, int]) -> str:
    (x0, y0, z0), (x1, y1, z1) = scene.room.lower_m, scene.room.upper_m
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    vertices = "\n".join(f"    ({x:.9g} {y:.9g} {z:.9g})" for z in (z0, z1) for x, y in corners)
    walls = "\n".join(
        f"    {name} {{ type wall; faces (({' '.join(map(str, face))})); }}"
        for name, face in zip(WALLS, FACES, strict=True)
    )
    counts = " ".join(map(str, cells))
    return (
        f"scale 1;\nvertices\n(\n{vertices}\n);\nblocks (hex (0 1 2 3 4 5 6 7) ({counts}) simpleGrading (1 1 1));\n"
        f"boundary\n(\n{walls}\n);\n"
    )


def _sets(scene: Scene, parts: dict[str, Part]) -> str:
    """Faces whose centres lie in an opening or a heater."""
    lines = []
    for name, part in parts.items():
        face = face_of(part.patch.wall)
        low, high = [0.0] * 3, [0.0] * 3
        low[face.axis] = high[face.axis] = face.place_m(scene.room)
        low[face.axis] -= 1e-4
        high[face.axis] += 1e-4
        for axis, a, b in zip(face.along, part.patch.lower_m, part.patch.upper_m, strict=True):
            low[axis], high[axis] = a, b
        box = " ".join("({:.9g} {:.9g} {:.9g})".format(*corner) for corner in (low, high))
        lines.append(f"    {{ name {name}; type faceSet; action new; source boxToFace; box {box}; }}\n")
    return "actions\n(\n" + "".join(lines) + ");\n"
