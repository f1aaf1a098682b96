"""A room as a case for OpenFOAM, and what is said where it cannot be one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.bench.foam_case import read_field, write_case
from app.bench.openfoam import rows
from app.errors import BadInputError
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RigOptions, room_scene
from core.geometry import WallName
from core.scene import Heater, Inlet, Patch, Wall

CELLS = (6, 5, 4)


def surveyed():
    return room_scene(read_volume(SAMPLE_ROOM), RigOptions(), "surveyed")


def heater_on(wall: WallName) -> Heater:
    return Heater(patch=Patch(wall=wall, lower_m=(0.1, 0.1), upper_m=(0.3, 0.3)), temperature_k=320.0)


def test_the_case_holds_what_the_scene_states(tmp_path: Path):
    scene = surveyed()
    inlet = next(part for part in scene.boundary if isinstance(part, Inlet))
    held = next(part for part in scene.boundary if isinstance(part, Wall) and part.temperature_k)

    write_case(tmp_path, scene, CELLS, every=10, most=20)

    velocity, kelvin = ((tmp_path / "0" / name).read_text() for name in "UT")
    assert "uniform ({:.7g} {:.7g} {:.7g});".format(*inlet.velocity_m_s) in velocity
    assert f"value uniform {inlet.temperature_k:.7g};" in kelvin
    assert f"{held.wall} {{ type fixedValue; value uniform {held.temperature_k:.7g}; }}" in kelvin
    assert "(6 5 4)" in (tmp_path / "system" / "blockMeshDict").read_text()
    assert (tmp_path / "system" / "topoSetDict").read_text().count("boxToFace") == sum(
        part.__class__.__name__ in ("Inlet", "Outlet") for part in scene.boundary
    )


def test_a_heater_on_the_floor_is_a_warm_wall_under_every_model(tmp_path: Path):
    scene = surveyed()
    scene = replace(scene, boundary=(*scene.boundary, heater_on("z_min")))

    write_case(tmp_path, scene, CELLS, every=10, most=20, turbulence="kOmegaSST", mean_from=5)

    assert "heater0 { type fixedValue; value uniform 320; }" in (tmp_path / "0" / "T").read_text()
    assert "name heater0; patchInfo { type wall; }" in (tmp_path / "system" / "createPatchDict").read_text()
    assert "kOmegaSST" in (tmp_path / "constant" / "turbulenceProperties").read_text()
    assert "omegaWallFunction" in (tmp_path / "0" / "omega").read_text()
    assert "timeStart 5" in (tmp_path / "system" / "controlDict").read_text()


def test_fields_come_back_with_x_fastest(tmp_path: Path):
    values = np.arange(120).reshape(4, 5, 6)
    words = "\n".join(map(str, values.ravel()))
    (tmp_path / "T").write_text(
        f"internalField nonuniform List<scalar>\n120\n(\n{words}\n)\n;\nboundaryField\n{{\n}}\n"
    )

    found = read_field(tmp_path / "T", CELLS)

    assert found.shape == (*CELLS, 1)
    assert found[1, 0, 0, 0] == 1
    assert found[0, 1, 0, 0] == 6
    assert found[0, 0, 1, 0] == 30


def test_a_room_that_the_case_cannot_hold_is_refused(tmp_path: Path):
    scene = surveyed()
    warm = heater_on("x_max")
    unknown = tuple(part for part in scene.boundary if not isinstance(part, Wall))

    with pytest.raises(BadInputError, match="heaters"):
        write_case(tmp_path / "a", replace(scene, boundary=(*scene.boundary, warm)), CELLS, 1, 1)
    (tmp_path / "b").mkdir()
    with pytest.raises(BadInputError, match="is not known"):
        write_case(tmp_path / "b", replace(scene, boundary=unknown), CELLS, 1, 1)


def test_without_openfoam_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "")

    with pytest.raises(BadInputError, match="Install OpenFOAM"):
        next(iter(rows(read_volume(SAMPLE_ROOM), 8)))
