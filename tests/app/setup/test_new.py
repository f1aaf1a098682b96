"""`airlens new`: from answers to an experiment, each wrong answer with its sentence, and on to a volume."""

import json
from typing import TypeVar

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.boundary import read_sensors
from app.experiment.folder import open_experiment
from app.pipeline import reconstruct
from app.rig.open import open_camera
from app.setup.experiment import TEMPLATES, new_experiment, template
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.file import read_volume
from core.geometry import face_of
from core.room.boundary_conditions import room_layout
from core.room.room_grid import room_grid
from core.scene import Inlet, Outlet, Scene
from drivers.burst import CapturePlan
from drivers.capture import run_capture

T = TypeVar("T")
JET = template("wall-jet")


# The packaged room, as a tape measure gives it: from its corner, which lies elsewhere in the volume's coordinates.
ANSWERS = """
title = "The packaged room, by hand"
room = ["4.1 m", "300 cm", "3 m"]
air = "20 C"
[camera]
kind = "simulated"
truth = "TRUTH"
width_px = 240
height_px = 180
frames = 20
angle_of_view = "10.3 deg"
distance = "30 m"
[[supply]]
wall = "x_min"
lower = ["1.2 m", "1.6 m"]
upper = ["1.8 m", "1.8 m"]
speed = "0.5 m/s"
temperature = "30 C"
[[outlet]]
wall = "x_min"
lower = ["1.2 m", "0.2 m"]
upper = ["1.8 m", "0.6 m"]
temperature = "OUTLET K"
"""


def run(*words, text: str | None = None) -> str:
    result = CliRunner().invoke(create_cli(), [str(word) for word in words], input=text)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def first(scene: Scene, kind: type[T]) -> T:
    return next(item for item in scene.boundary if isinstance(item, kind))


def test_a_capture_of_the_packaged_room_is_not_saturated(tmp_path):
    (tmp_path / "answers.toml").write_text(template("sample"))
    run("new", tmp_path / "lab", "--from", tmp_path / "answers.toml")
    with open_camera(open_experiment(tmp_path / "lab"), "still") as camera:
        verdicts = run_capture(camera, CapturePlan(frames=2)).verdicts
    assert [one.good for one in verdicts if one.name == "saturation"] == [True]


@pytest.mark.parametrize("name", TEMPLATES)
def test_every_template_is_an_experiment_that_a_solver_can_lay_out(name, tmp_path):
    answers = tmp_path / "answers.toml"
    answers.write_text(run("new", "--template", name))
    said = run("new", tmp_path / "lab", "--from", answers)
    seen = (
        "5.41 x 4.06 m of a wall of 4.1 x 3 m" if name == "sample" else "4.50 x 2.81 m of a wall of 4 x 2.7 m"
    )
    assert f"the camera sees {seen}" in said
    made = open_experiment(tmp_path / "lab")
    scene = made.settings.scene
    room_layout(scene, room_grid(scene.room, 12))
    read_sensors(made, scene)
    assert (tmp_path / "lab" / "answers.toml").read_text() == answers.read_text()


def test_what_was_measured_in_hours_and_degrees_is_kept_in_si(tmp_path):
    scene = new_experiment(tmp_path / "lab", JET, "answers").settings.scene
    inlet, outlet = first(scene, Inlet), first(scene, Outlet)
    assert inlet.temperature_k == pytest.approx(299.15)
    flow_m3_s = inlet.velocity_m_s[0] * inlet.patch.area_m2
    assert 3600 * flow_m3_s == pytest.approx(120)
    assert inlet.velocity_std_m_s == pytest.approx(0.05 * inlet.velocity_m_s[0])
    assert outlet.mean_temperature_k == pytest.approx(295.15)
    camera = scene.views[0].camera
    assert camera.position_m == (2.0, -1.0, 1.35)
    # World y lies along the optical axis.
    np.testing.assert_allclose(camera.rotation @ [0, 1, 0], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("wall", ["x_min", "x_max", "y_min", "z_min", "z_max"])
def test_a_supply_blows_into_the_room_from_every_wall(wall, tmp_path):
    text = JET.replace('wall = "x_min"', f'wall = "{wall}"').replace("2.5 m", "1.2 m").replace("2.3 m", "1 m")
    inlet = first(new_experiment(tmp_path / "lab", text, "answers").settings.scene, Inlet)
    face = face_of(wall)
    assert face.inward * inlet.velocity_m_s[face.axis] > 0
    assert np.count_nonzero(inlet.velocity_m_s) == 1


WRONG = [
    ('air = "20 C"', 'air = "20"', r"air: .*'20' has no unit.*18 C"),
    ('air = "20 C"', "air = 293.15", r"air: .*in quotes"),
    ('air = "20 C"', 'air = "20 K"', r"air: .*'20 K' is out of range.*is the unit right"),
    ('air = "20 C"', "", r"air: it is missing"),
    ('["4 m", "3 m", "2.7 m"]', '["4000 m", "3 m", "2.7 m"]', r"room.0: .*millimetres \(4000 mm\)"),
    ('["4 m", "3 m", "2.7 m"]', '["4 m", "3 m"]', r"room"),
    ('["4 m", "3 m", "2.7 m"]', '["4 m", "3 m", "2.7 l"]', r"room.2: .*'l' is no unit of length"),
    ('flow = "120 m3/h"', 'flow = "120 m3"', r"supply.0.flow: .*no unit of volume flow.*m3/h"),
    ('flow = "120 m3/h"', 'flow = "120 m3/h"\nspeed = "1 m/s"', r"supply.0: .*flow or speed, and not both"),
    ('flow = "120 m3/h"', "", r"supply.0: .*flow or speed"),
    ('flow = "120 m3/h"', 'speed = "-1 m/s"', r"supply.0: .*above 0"),
    ('flow = "120 m3/h"', 'flow = "-5 m3/h"', r"supply.0.flow: .*out of range"),
    ('deviation = "5 %"', 'deviation = "5"', r"supply.0.deviation: .*has no unit"),
    ('deviation = "5 %"', 'deviation = "500 %"', r"supply.0.deviation: .*0.01 to 100 %"),
    ('wall = "x_min"', 'wall = "left"', r"supply.0.wall: .*x_min"),
    ('wall = "x_min"', 'wal = "x_min"', r"unknown key 'supply.0.wal'; did you mean 'wall'"),
    (
        '["1.8 m", "2.5 m"]',
        '["1.8 m", "2.9 m"]',
        r"supply.0.upper.1: 2.3 to 2.9 m along z is not on x_min.*0 to 2.7 m",
    ),
    (
        '["1.8 m", "2.5 m"]',
        '["1 m", "2.5 m"]',
        r"line \d+, column \d+: supply.0.upper.0: lower is 1.2 m and upper 1 m along y",
    ),
    ('["1.8 m", "2.5 m"]', '["1800 m", "2.5 m"]', r"supply.0.upper.0: .*millimetres"),
    ('wall = "x_max"', 'wall = "x_min"\nkind = "outlet"', r"unknown key 'outlet.0.kind'"),
    ("[[outlet]]", "[[surface]]", r"1 supplies and 0 outlets.*must leave"),
    (
        '"x_max"\nlower = ["1.2 m", "0.1 m"]\nupper = ["1.8 m", "0.3 m"]',
        '"x_min"\nlower = ["1.5 m", "2.4 m"]\nupper = ["2 m", "2.6 m"]',
        r"outlet.0: it overlaps supply 1 on x_min",
    ),
    ('distance = "4 m"', "", r"camera: .*give distance .* or position"),
    (
        'distance = "4 m"',
        'position = ["2 m", "3.5 m", "1 m"]',
        r"line \d+, column \d+: camera.position.1: y is 3.5 m, at or behind",
    ),
    ('distance = "4 m"', 'distance = "0 m"', r"camera.distance: .*above zero"),
    ('focal_length = "10 mm"', "", r"camera: .*angle_of_view, or focal_length and pixel_pitch"),
    ('focal_length = "10 mm"', 'angle_of_view = "400 deg"', r"camera.angle_of_view: .*1 to 170 degrees"),
    ('kind = "v4l2"', 'kind = "usb"', r"camera.kind: .*v4l2"),
    ('kind = "v4l2"', 'kind = "simulated"', r"camera: .*give truth"),
    ("width_px = 1920", "width_px = 3", r"camera.width_px: .*16"),
    ('exposure = "20 ms"', 'exposure = "20 m"', r"camera.exposure: .*'m' is no unit of time"),
    ('exposure = "20 ms"', 'exposure = "500 s"', r"camera.exposure: .*60 s"),
    ("bits = 12", "bits = 40", r"camera.bits: .*16"),
    (
        '["2 m", "1.5 m", "1.1 m"]',
        '["2 m", "1.5 m", "11 m"]',
        r"thermometer.0.position.2: 11 m along z is outside the room",
    ),
    ('temperature = "22.4 C"', 'temperature = "22,4 C"', r"thermometer.0.temperature: "),
    (
        'temperature_deviation = "0.3 K"',
        'temperature_deviation = "0 K"',
        r"temperature_deviation: .*0.001 to 100",
    ),
    ("[[thermometer]]", '[[wall]]\nwall = "z_max"\n[[thermometer]]', r"wall.0: .*adiabatic = true"),
    (
        "[[thermometer]]",
        '[[wall]]\nwall = "z_max"\nadiabatic = true\n' * 2 + "[[thermometer]]",
        r"wall.1.wall: z_max is answered twice",
    ),
    ("[[supply]]", "[[inlet]]", r"unknown key 'inlet'"),
    ("[camera]", "[camera", r"line \d+, column \d+: it is not valid TOML"),
]


@pytest.mark.parametrize(("right", "wrong", "sentence"), WRONG)
def test_a_wrong_answer_is_said_at_its_place_and_nothing_is_left(right, wrong, sentence, tmp_path):
    assert right in JET
    with pytest.raises(BadInputError, match=sentence):
        new_experiment(tmp_path / "lab", JET.replace(right, wrong, 1), "answers.toml")
    assert not (tmp_path / "lab").exists()


def test_a_folder_that_holds_something_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("keep")
    with pytest.raises(BadInputError, match="not empty"):
        new_experiment(tmp_path, JET, "answers")
    assert (tmp_path / "notes.txt").read_text() == "keep"


def test_without_answers_the_way_to_them_is_said(tmp_path):
    with pytest.raises(BadInputError, match="airlens new --template wall-jet"):
        run("new", tmp_path / "lab", text="")
    with pytest.raises(BadInputError, match="radiator"):
        run("new", "--template", "cellar")


def test_the_schema_knows_every_answer():
    known = json.loads(run("schema", "answers"))
    assert {"room", "air", "camera", "supply", "thermometer"} <= known["properties"].keys()
    experiment = json.loads(run("schema"))
    assert {"rig", "scene"} <= experiment["properties"].keys()


def test_from_a_pipe_of_answers_to_a_volume(tmp_path):
    """The packaged room, as a tape measure and a thermometer give it, and a camera that looks at it."""
    truth = read_volume(SAMPLE_ROOM)
    outlet_k = float(truth.temperature_k[0][18:30, 3:10].mean())
    text = ANSWERS.replace("TRUTH", str(SAMPLE_ROOM)).replace("OUTLET", f"{outlet_k:.2f}")
    said = run("new", tmp_path / "lab", "--from", "-", text=text)
    assert "Next: airlens plan" in said
    run("preview", tmp_path / "lab")
    for role in ("reference", "flow"):
        run("capture", role, tmp_path / "lab", "--frames", 20)
    reconstruct(tmp_path / "lab", "draft")
    scored = json.loads(run("score", tmp_path / "lab", "--truth", SAMPLE_ROOM, "--json"))
    print(scored)
    # Nothing is still beside this wall, so the mean gradient may be the camera's. Ambient air: 6.6 K.
    assert scored["T"]["rms_K"] < 0.8
