"""An OpenFOAM case with objects: what is cut out of the mesh, each object's patch, and its heat.

By the text of the case; and by OpenFOAM itself, where blockMesh is installed (checked with 1912).
"""

import re
import shutil
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from app.bench.openfoam import environment
from app.errors import BadInputError
from app.experiment.folder import write_manifest
from app.experiment.found import Found
from app.experiment.results import write_result
from app.files.toml import to_plain
from app.report.export import export
from app.report.openfoam import write_openfoam
from app.setup.experiment import new_experiment, template
from core.air import Air
from core.geometry import WALLS
from core.objects import RoomObject, ready_object
from core.result import Solution

PERSON = ready_object("seated_person", "seated person 1", (2.03, 1.1, 0.0))
# Against a wall, with the wall's name; and against the person, 0.4 m x 0.5 m of both being shared.
SHELF = RoomObject(name="x_min", lower_m=(0.0, 1.0, 1.0), upper_m=(0.31, 1.777, 1.5))
WARM = RoomObject(
    name="2nd box",
    lower_m=(2.23, 0.9, 0.0),
    upper_m=(3.0, 1.3, 0.5),
    thermal="temperature",
    temperature_k=303.15,
)
OBJECTS = (PERSON, SHELF, WARM)
NAMES = ("seated_person_1", "x_min_", "object_2nd_box")
# Faces in the air: the whole surface without the floor, the wall, and what two objects share.
AREAS_M2 = (
    4 * 0.4 * 1.2 + 0.4 * 0.4 - 0.2,
    2 * 0.31 * (0.777 + 0.5) + 0.777 * 0.5,
    0.77 * 0.4 + 2 * (0.77 + 0.4) * 0.5 - 0.2,
)


def solution(objects=OBJECTS) -> Solution:
    """T, u and p are linear in x, y and z: the values between vertices are known."""
    axes = [np.linspace(0, size, n, dtype=np.float32) for size, n in ((4, 33), (3, 25), (2.7, 23))]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    kelvin = np.asarray(290 + x + 2 * y + 3 * z, np.float32)
    wind = np.asarray(np.stack([x, y, z], -1), np.float32)
    return Solution(
        *axes, temperature_k=kelvin, velocity_m_s=wind, pressure_m2_s2=kelvin - 290
    ).without_objects(objects)


@pytest.fixture
def case(tmp_path):
    write_openfoam(tmp_path / "case.zip", solution(), OBJECTS, Air())
    with zipfile.ZipFile(tmp_path / "case.zip") as packed:
        packed.extractall(tmp_path)
    return tmp_path / "case"


class Mesh:
    """A blockMeshDict as text: blocks, their cells in blockMesh's order, and the patches' faces."""

    def __init__(self, text: str) -> None:
        head, tail = text.split("boundary\n")
        points = re.findall(r"^    \((\S+) (\S+) (\S+)\)$", head, re.MULTILINE)
        self.points_m = np.array(points, float)
        hexes = re.findall(r"hex \(([^)]+)\) \(([^)]+)\)", head)
        self.blocks = [
            ([int(i) for i in one.split()], [int(n) for n in counts.split()]) for one, counts in hexes
        ]
        self.patches = {
            name: [
                [int(i) for i in face.split()] for face in re.findall(r"^ {12}\((.+)\)$", faces, re.MULTILINE)
            ]
            for name, faces in re.findall(r"^    (\w+)\n    \{(.*?)\n    \}", tail, re.MULTILINE | re.DOTALL)
        }

    def centres_m(self) -> np.ndarray:
        """Cell by cell; x is fastest in a block."""
        found = []
        for corners, counts in self.blocks:
            low, high = self.points_m[corners[0]], self.points_m[corners[6]]
            x, y, z = (
                a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, counts, strict=True)
            )
            k, j, i = np.meshgrid(z, y, x, indexing="ij")
            found.append(np.stack([i, j, k], -1).reshape(-1, 3))
        return np.concatenate(found)

    def volume_m3(self) -> float:
        return sum(np.prod(self.points_m[c[6]] - self.points_m[c[0]]) for c, _ in self.blocks)

    def areas_m2(self, name: str) -> np.ndarray:
        """Of each face of a patch, along its outward normal."""
        quads = self.points_m[self.patches[name]]
        return 0.5 * np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])


def values(text: str, parts: int = 1) -> np.ndarray:
    body = text.split("\n(\n")[1].split("\n)")[0]
    return np.array(body.translate(str.maketrans("()", "  ")).split(), float).reshape(-1, parts)


def test_the_objects_are_no_part_of_the_mesh(case):
    mesh = Mesh((case / "system" / "blockMeshDict").read_text())
    centres_m = mesh.centres_m()
    for item in OBJECTS:
        assert not ((centres_m > item.lower_m) & (centres_m < item.upper_m)).all(1).any()
    # float32 vertices end at 2.7 m to 5e-8 m.
    solid_m3 = sum(np.prod(item.size_m) for item in OBJECTS)
    assert mesh.volume_m3() == pytest.approx(4 * 3 * 2.7 - solid_m3, rel=1e-6)


def test_each_object_has_a_patch_of_its_own_faces_in_the_air(case):
    mesh = Mesh((case / "system" / "blockMeshDict").read_text())
    assert tuple(mesh.patches) == (*WALLS, *NAMES)
    for name, area_m2, item in zip(NAMES, AREAS_M2, OBJECTS, strict=True):
        assert np.linalg.norm(mesh.areas_m2(name), axis=1).sum() == pytest.approx(area_m2, rel=1e-6)
        corners_m = mesh.points_m[np.unique(mesh.patches[name])]
        np.testing.assert_allclose(corners_m.min(0), item.lower_m, atol=1e-7)
        np.testing.assert_allclose(corners_m.max(0), item.upper_m, atol=1e-7)
    # The faces of air that touches anything close: their normals sum to zero.
    np.testing.assert_allclose(sum(mesh.areas_m2(name).sum(0) for name in mesh.patches), 0.0, atol=1e-9)
    assert np.linalg.norm(mesh.areas_m2("z_max").sum(0)) == pytest.approx(12.0)


def test_cells_hold_the_values_at_their_middles_in_blockmeshs_order(case):
    centres_m = Mesh((case / "system" / "blockMeshDict").read_text()).centres_m()
    beside = np.zeros(len(centres_m), bool)
    for item in OBJECTS:  # one cell of the result is up to 0.125 m
        low_m, high_m = np.array(item.lower_m) - 0.126, np.array(item.upper_m) + 0.126
        beside |= ((centres_m > low_m) & (centres_m < high_m)).all(1)
    assert beside.mean() < 0.05
    kelvin, wind = (values((case / "0" / name).read_text(), parts) for name, parts in (("T", 1), ("U", 3)))
    # Seven digits are written, of float32 vertices.
    np.testing.assert_allclose(kelvin[~beside, 0], 290 + (centres_m @ [1, 2, 3])[~beside], atol=1e-4)
    np.testing.assert_allclose(wind[~beside], centres_m[~beside], atol=1e-5)
    assert np.isfinite(kelvin).all()


def test_each_patch_has_what_is_known_of_its_objects_heat(case):
    kelvin, wind = ((case / "0" / name).read_text() for name in ("T", "U"))
    for name in (*WALLS, "x_min_"):
        assert f"    {name} {{ type zeroGradient; }}\n" in kelvin
    assert "    object_2nd_box { type fixedValue; value uniform 303.15; }\n" in kelvin
    gradient = float(
        re.search(r"seated_person_1 \{ type fixedGradient; gradient uniform (\S+); \}", kelvin)[1]
    )
    # 1.2041 kg/m3 of 1006 J/(kg K), and a diffusivity of 1.5e-5 / 0.71 m2/s.
    conducted_w = gradient * AREAS_M2[0] * 1.2041 * 1006 * 1.5e-5 / 0.71
    assert conducted_w == pytest.approx(75.0, rel=1e-3)
    assert "75 W, give or take 20 W" in kelvin
    assert all(f"    {name} {{ type noSlip; }}\n" in wind for name in NAMES)


def test_a_room_without_objects_has_the_results_own_cells(tmp_path):
    write_openfoam(tmp_path / "case.zip", solution(()))
    with zipfile.ZipFile(tmp_path / "case.zip") as packed:
        mesh = Mesh(packed.read("case/system/blockMeshDict").decode())
    assert [counts for _, counts in mesh.blocks] == [[32, 24, 22]]
    assert tuple(mesh.patches) == WALLS


@pytest.mark.parametrize(
    ("objects", "sentence"),
    [
        ((PERSON, SHELF), "other objects than experiment.toml"),
        (
            (*OBJECTS, RoomObject(name="new", lower_m=(3.0, 2.0, 0.0), upper_m=(3.5, 2.5, 1.0))),
            "other objects",
        ),
        (
            (*OBJECTS, RoomObject(name="foil", lower_m=(3.0, 2.0, 0.0), upper_m=(3.5, 2.5, 1e-6))),
            "thinner than 0.01 mm",
        ),
    ],
)
def test_objects_that_the_result_does_not_know_are_refused(objects, sentence, tmp_path):
    with pytest.raises(BadInputError, match=sentence):
        write_openfoam(tmp_path / "case.zip", solution(), objects)
    assert not (tmp_path / "case.zip").exists()


def test_the_export_of_an_experiment_knows_its_objects_and_what_was_found(tmp_path):
    answers = template("wall-jet") + '\n[[object]]\nkind = "desk"\nposition = ["2 m", "1 m", "0 m"]\n'
    experiment = new_experiment(tmp_path / "lab", answers, "answers.toml")
    folder = experiment.results_folder / "one"
    folder.mkdir(parents=True)
    box = RoomObject(name="found 1", lower_m=(0.5, 0.5, 0.0), upper_m=(1.0, 0.9, 1.2))
    seen = Found(0, 0.1, (0.5, 1.0), (0.0, 1.2), (64.0, 40.0, 88.0, 90.0), "seen", box, True, "It stands.")
    only_said = replace(
        seen, box=replace(box, name="found 2", lower_m=(3.2, 2.2, 0.0), upper_m=(3.6, 2.6, 1.0))
    )
    only_said = replace(only_said, solved=False)
    write_manifest(folder, {"found": to_plain((seen, only_said))})
    write_result(folder / "result.nc", solution((*experiment.settings.scene.objects, box)), {})
    with zipfile.ZipFile(export(tmp_path / "lab", "zip", result=folder)) as packed:
        mesh = Mesh(packed.read("case/system/blockMeshDict").decode())
    solid_m3 = 1.6 * 0.8 * 0.74 + 0.5 * 0.4 * 1.2
    assert mesh.volume_m3() == pytest.approx(4 * 3 * 2.7 - solid_m3, rel=1e-6)
    assert tuple(mesh.patches) == (*WALLS, "desk_1", "found_1")


@pytest.mark.skipif(not shutil.which("blockMesh"), reason="OpenFOAM is not installed here.")
def test_openfoam_makes_the_mesh_and_the_heat_is_the_persons(case):
    # zipfile leaves the modes of files behind.
    (case / "Allrun").chmod(0o755)
    made = subprocess.run([case / "Allrun"], env=environment(), capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    assert "Mesh OK." in made.stdout
    # Conduction alone, from 290 K everywhere and nothing else held: after 100 s the air has 100 s of the heat.
    cells = len(values((case / "0" / "T").read_text()))
    boundary = (case / "0" / "T").read_text().split("boundaryField")[1]
    boundary = boundary.replace("fixedValue; value uniform 303.15;", "zeroGradient;")
    head = "FoamFile {{ version 2.0; format ascii; class {}; object {}; }}\n"
    (case / "0" / "T").write_text(
        head.format("volScalarField", "T")
        + f"dimensions [0 0 0 1 0 0 0];\ninternalField uniform 290;\nboundaryField{boundary}"
    )
    (case / "constant" / "transportProperties").write_text(
        head.format("dictionary", "transportProperties") + f"DT DT [0 2 -1 0 0 0 0] {1.5e-5 / 0.71};\n"
    )
    with (case / "system" / "fvSolution").open("a") as file:
        file.write("solvers { T { solver PCG; preconditioner DIC; tolerance 1e-12; relTol 0; } }\n")
        file.write("SIMPLE { nNonOrthogonalCorrectors 0; }\n")
    for name, old, new in (
        ("fvSchemes", "steadyState", "Euler"),
        ("controlDict", "endTime 0;\ndeltaT 1;\nwriteControl timeStep;\nwriteInterval 1;",
         "endTime 100;\ndeltaT 10;\nwriteControl timeStep;\nwriteInterval 10;"),
    ):  # fmt: skip
        file = case / "system" / name
        assert old in file.read_text()
        file.write_text(file.read_text().replace(old, new))
    for command in (["laplacianFoam"], ["postProcess", "-func", "writeCellVolumes", "-time", "100"]):
        done = subprocess.run(
            command, cwd=case, env=environment(), capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    kelvin, volumes_m3 = (values((case / "100" / name).read_text()) for name in ("T", "V"))
    assert len(kelvin) == cells
    heat_w = ((kelvin - 290) * volumes_m3).sum() * Air().heat_capacity_j_m3_k / 100
    # T is written with nine digits.
    assert heat_w == pytest.approx(75.0, rel=1e-4)
