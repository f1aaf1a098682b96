import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from app.errors import BadInputError
from app.volume.file import read_volume
from app.volume.scene import known_boundary, room_box
from core.room.openings import supply_turbulence

ROOM = Path(str(files("app.simulate.sample") / "room.npz"))


@pytest.fixture
def arrays():
    with np.load(ROOM) as file:
        return {name: file[name] for name in file.files}


def saved(path, arrays):
    np.savez(path, **arrays)
    return path


def test_the_packaged_room_is_small_and_says_where_it_is_from():
    assert ROOM.stat().st_size <= 1_500_000
    with np.load(ROOM) as file:
        assert "OpenFOAM" in json.loads(str(file["meta_json"]))["origin"]
    assert room_box(read_volume(ROOM)).upper_m == (2.9, 1.5, 3.0)


def change(name, value):
    return lambda arrays: arrays.__setitem__(name, value(arrays))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda a: a.pop("u"), "has no u"),
        (change("T", lambda a: a["T"][:-1]), "T has shape"),
        (change("T", lambda a: np.where(a["T"] > 302, np.nan, a["T"])), "not finite"),
        (change("T", lambda a: a["T"] - 273.15 - 30), "degrees Celsius"),
        (change("T", lambda a: a["T"] * 0 - 300), "expected kelvin"),
        (change("x", lambda a: a["x"] * 0), "no volume"),
        (change("meta_json", lambda a: np.array("{")), "cannot be read"),
    ],
)
def test_a_volume_that_cannot_be_is_refused_by_name(tmp_path, arrays, damage, words):
    damage(arrays)
    with pytest.raises(BadInputError, match=words):
        read_volume(saved(tmp_path / "room.npz", arrays))


@pytest.mark.parametrize("keep", [0, 10, 5000])
def test_a_truncated_file_is_refused(tmp_path, keep):
    path = tmp_path / "room.npz"
    path.write_bytes(ROOM.read_bytes()[:keep])
    with pytest.raises(BadInputError, match="truncated"):
        read_volume(path)


def test_pickled_arrays_are_refused(tmp_path, arrays):
    arrays["T"] = np.array([{}, {}], dtype=object)
    with pytest.raises(BadInputError, match="cannot be read"):
        read_volume(saved(tmp_path / "room.npz", arrays))


def test_information_levels_tell_what_they_promise():
    volume = read_volume(ROOM)
    kinds = {
        level: [k.kind for k in known_boundary(volume, level)] for level in ("paper", "operator", "surveyed")
    }
    assert kinds["paper"] == ["plane_field"]
    assert set(kinds["operator"]) == {"inlet", "outlet", "wall"}
    assert set(kinds["surveyed"]) == {"plane_field", "inlet", "outlet", "wall"}
    walls = [k for k in known_boundary(volume, "operator") if k.kind == "wall"]
    assert {w.thermal for w in walls} == {"unknown"}
    surveyed = {k.wall: k.thermal for k in known_boundary(volume, "surveyed") if k.kind == "wall"}
    assert surveyed == {
        "x_min": "adiabatic",
        "x_max": "temperature",
        "y_min": "temperature",
        "y_max": "temperature",
        "z_min": "adiabatic",
        "z_max": "adiabatic",
    }


def test_a_supplys_length_scale_is_a_share_of_its_patchs_diameter():
    supply = next(k for k in known_boundary(read_volume(ROOM), "operator") if k.kind == "inlet")

    # What the case's own dictionaries hold for 0.6 x 0.2 m, 0.5 m/s, 10 % and 0.07.
    assert supply_turbulence(supply) == pytest.approx((0.00375, 0.00179684), rel=1e-5)
