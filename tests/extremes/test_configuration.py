"""Text and files at the edge: what is no experiment, no plane, no table, no volume; Celsius and millimetres."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.experiment.boundary import read_plane, read_planes, read_sensor_table
from app.experiment.capture_files import read_image
from app.experiment.folder import Experiment, ExperimentSettings, open_experiment
from app.files.toml import read_toml, to_toml
from app.volume.file import read_volume
from core.geometry import Box, looking_along_y
from core.scene import FixedTexture, PlaneField, Scene, View
from tests.extremes.row import Named, Near, Refused, Row, extremes, prove

STAGE = "configuration"
CAMERA = looking_along_y(position_m=(2.0, -5.0, 1.5), width_px=64, height_px=48, focal_px=100.0)
SCENE = Scene(
    room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0)),
    views=(View(camera=CAMERA),),
    light=FixedTexture(),
)
TEXT = to_toml(ExperimentSettings(scene=SCENE))


@pytest.fixture(autouse=True, scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    global FOLDER
    FOLDER = tmp_path_factory.mktemp("extremes")


FOLDER = Path()


def written(name: str, content: bytes) -> Path:
    path = FOLDER / name
    path.write_bytes(content)
    return path


def toml(name: str, expected, old: str = "", new: str = "", text: str | bytes | None = None) -> Row:
    """The experiment's text with one change, or another text."""

    def run() -> float:
        changed = TEXT.replace(old, new, 1) if text is None else text
        assert changed != TEXT or not old, f"{old!r} is not in the text"
        content = changed if isinstance(changed, bytes) else changed.encode()
        return float(len(read_toml(written("experiment.toml", content), ExperimentSettings).scene.views))

    return Row(STAGE, f"TOML: {name}", run, expected)


def plane(name: str, expected, **changed: np.ndarray) -> Row:
    """A plane field on x_min, with some arrays changed."""

    def run() -> np.ndarray:
        arrays = {"y": np.linspace(0, 3, 4), "z": np.linspace(0, 3, 5), "T": np.full((4, 5), 300.0)}
        arrays |= {"p": np.zeros((4, 5)), "u": np.zeros((4, 5, 3))} | changed
        path = FOLDER / "plane.npz"
        np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
        known = replace(SCENE, boundary=(PlaneField(file="plane.npz", wall="x_min"),))
        return read_planes(Experiment(FOLDER, ExperimentSettings(scene=known)), known)[0].temperature_k

    return Row(STAGE, f"plane: {name}", run, expected)


def sensors(name: str, expected, text: str) -> Row:
    def run() -> np.ndarray:
        return read_sensor_table(written("sensors.csv", text.encode()), SCENE).temperature_k

    return Row(STAGE, f"sensors: {name}", run, expected)


def volume(name: str, expected, **changed: object) -> Row:
    def run() -> float:
        line = np.linspace(0.0, 1.0, 3)
        arrays = {"x": line, "y": line, "z": line, "T": np.full((3, 3, 3), 300.0), "T0": 293.0}
        arrays |= {"p": np.zeros((3, 3, 3)), "u": np.zeros((3, 3, 3, 3))} | changed
        path = FOLDER / "volume.npz"
        np.savez(path, **{k: v for k, v in arrays.items() if v is not None})  # type: ignore[arg-type]
        return float(read_volume(path).temperature_k.max())

    return Row(STAGE, f"volume: {name}", run, expected)


def file(name: str, words: str, read: Callable[[Path], object], content: bytes) -> Row:
    return Row(STAGE, name, lambda: str(read(written("file", content))), Refused(words))


def again() -> str:
    """What is written is read back equal, at the ends of the ranges."""
    far = replace(CAMERA, position_m=(2.0, -997.0, 1.5), focal_px=(2.0e5, 1.0e5), width_px=8192)
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(0.01, 3.0, 100.0))
    settings = ExperimentSettings(scene=replace(SCENE, room=room, views=(View(camera=far, frames=1),)))
    back = read_toml(written("again.toml", to_toml(settings).encode()), ExperimentSettings)
    return "equal" if back == settings else "different"


HOT = "x,y,z,T\n1,1,1,{}\n"

ROWS = [
    toml("as it should be", Near(1.0), "", ""),
    toml("empty", Refused("scene"), text=""),
    toml("not text", Refused("cannot be read"), text=b"\xff\xfe\x00\x01"),
    toml("cut short", Refused("not valid TOML"), text=TEXT[: len(TEXT) // 2] + "\n[["),
    toml("deeply nested", Refused("not valid TOML|unknown key"), text="a = " + "[" * 60 + "]" * 60),
    toml("unknown key", Refused("did you mean 'title'"), "title", "titel"),
    toml("unknown kind of light", Refused("light"), 'kind = "texture"', 'kind = "laser"'),
    toml("text for a number", Refused("pressure_pa"), "pressure_pa = 101325.0", 'pressure_pa = "much"'),
    toml("truth for a number", Refused("pressure_pa"), "pressure_pa = 101325.0", "pressure_pa = true"),
    toml("a date for a number", Refused("type"), "pressure_pa = 101325.0", "pressure_pa = 2026-01-01"),
    toml("NaN", Refused("pressure_pa|not finite"), "pressure_pa = 101325.0", "pressure_pa = nan"),
    toml("infinite focal length", Refused("Focal|finite"), "focal_px = [100.0, 100.0]", "focal_px = [inf, 100.0]"),
    toml("a place that is NaN", Refused("finite"), "position_m = [2.0, -5.0, 1.5]", "position_m = [2.0, nan, 1.5]"),
    toml("a number of 400 digits", Refused("frames"), "frames = 100", "frames = 1" + "0" * 400),
    toml("half a frame", Refused("frames"), "frames = 100", "frames = 0.5"),
    toml("a room in millimetres", Refused("millimetres"), "upper_m = [4.0, 3.0, 3.0]",
         "upper_m = [4000.0, 3000.0, 3000.0]"),
    toml("ambient in Celsius", Refused("Celsius"), "ambient_temperature_k = 293.15", "ambient_temperature_k = 20.0"),
    toml("another schema", Refused("schema_version"), "schema_version = 1", "schema_version = 99"),
    Row(STAGE, "TOML: limits written and read again", again, Named("equal")),
    Row(STAGE, "no such folder", lambda: str(open_experiment(FOLDER / "nowhere")), Refused("There is no")),
    Row(STAGE, "a file outside the experiment",
        lambda: str(Experiment(FOLDER, ExperimentSettings(scene=SCENE)).file("../../secret")), Refused("outside")),
    plane("as it should be", Near(300.0)),
    plane("Celsius", Refused("kelvin"), T=np.full((4, 5), 22.0)),
    plane("a gap", Refused("finite"), T=np.full((4, 5), np.nan)),
    plane("another shape", Refused("shape"), p=np.zeros((5, 4))),
    plane("no velocity", Refused("'u is not a file in the archive' is missing"), u=None),
    plane("coordinates in millimetres", Refused("millimetres|outside|increase"), y=np.linspace(0, 3000, 4)),
    plane("coordinates that fall", Refused("increase"), z=np.linspace(3, 0, 5)),
    plane("one line", Refused("increase|shape|two"), y=np.zeros(1)),
    file("a plane that is no NPZ", "cannot be read", lambda p: read_plane(p, "x_min"), b"nothing"),
    sensors("as it should be", Near(300.0), HOT.format(300)),
    sensors("Celsius", Refused("kelvin"), HOT.format(22)),
    sensors("5 million kelvin", Refused("kelvin"), HOT.format("5e6")),
    sensors("infinite", Refused("kelvin|finite"), HOT.format("inf")),
    sensors("millimetres", Refused("millimetres"), "x,y,z,T\n1000,1000,1000,300\n"),
    sensors("a word", Refused("expected a number"), HOT.format("warm")),
    sensors("an unknown column", Refused("unknown columns"), "x,y,z,temperature\n1,1,1,300\n"),
    sensors("no rows", Refused("no rows"), "x,y,z,T\n"),
    sensors("no place", Refused("every sensor needs"), "x,y,z,T\n1,,1,300\n"),
    sensors("a place that is NaN", Refused("outside|finite|number"), "x,y,z,T\nnan,1,1,300\n"),
    sensors("an uncertainty of 0", Refused("T_std"), "x,y,z,T,T_std\n1,1,1,300,0\n"),
    volume("as it should be", Near(300.0)),
    volume("Celsius", Refused("Celsius"), T=np.full((3, 3, 3), 22.0)),
    volume("ambient in Celsius", Refused("T0"), T0=20.0),
    volume("ambient NaN", Refused("T0"), T0=np.nan),
    volume("infinite", Refused("finite"), T=np.full((3, 3, 3), np.inf)),
    volume("one layer", Refused("increase|shape"), x=np.zeros(1)),
    volume("upside down", Refused("increase"), z=np.linspace(1, 0, 3)),
    volume("no pressure", Refused("has no p"), p=None),
    file("a volume that is no NPZ", "cannot be read", read_volume, b"PK\x03\x04cut short"),
    file("an image that is no TIFF", "A capture's image", read_image, b"II*\x00"),
]  # fmt: skip


@extremes(ROWS)
def test_the_edge_at_its_limits(row: Row, record_property):
    prove(row, record_property)
