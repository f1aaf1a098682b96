"""`airlens new EXPERIMENT` asks: from a pipe, at a terminal, interrupted, gone back, and with wrong answers."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.files.toml import toml_data
from app.interview.conversation import DRAFT_FILE, Piped
from app.interview.questions import Inventory
from app.interview.talk import talk
from app.rig.inventory import SIMULATED, CameraChoice, FormatChoice
from app.rig.ports import FoundPort, who_is_there
from app.setup.experiment import SAMPLE, template
from drivers.clock import SystemClock
from drivers.simulated.projector.hosts import PtyHost
from tests.drivers.projector.twins import make_twin

AIRLENS = [sys.executable, "-c", "from app.cli import main; main()", "new"]
FORMATS = (FormatChoice("Y16", 16, 1920, 1200), FormatChoice("GREY", 8, 640, 480))
CAMERA = CameraChoice("v4l2", "/dev/video7", "A camera", "Y16", 16, 1920, 1200, formats=FORMATS)
DEAD = CameraChoice("v4l2", "/dev/video8", "Another", "", 0, 0, 0, "It is in use.")
# A jet as a tape measure gives it; an empty line takes the default that is shown.
JET = """\
# Devices
/dev/video7
Y16 1920x1200
wall-jet
12
# Room
A lab
4 m
3
270 cm
20 C
1
x_min
1.2
1.8
2.3
2.5
180 m3/h
5 %
26
0.3
1
x_max
1.2
1.8
0.1
0.3
none
0
0
0
1
2
1.5
1.1
22.4
0.3
0
# Wall
print
# Place
59 deg
1920
1200
4 m
20 ms
50
# Further cameras
0
"""


def inventory(**other) -> Inventory:
    return Inventory(
        **{"cameras": (CAMERA, DEAD, SIMULATED), "ports": (), "who": lambda device: None} | other
    )


class Script(Piped):
    """Answers from a text; keeps what it was told and refused, as a person at a terminal would see it."""

    def __init__(self, text: str, patient: bool = False) -> None:
        self.lines = text.splitlines(keepends=True)
        super().__init__(lambda: self.lines.pop(0) if self.lines else "")
        self.patient, self.told, self.refused = patient, [], []

    def say(self, text):
        self.told.append(text)

    def refuse(self, question, reason):
        self.refused.append(reason)
        if not self.patient:
            super().refuse(question, reason)


def answered(folder: Path, text: str, **other):
    script = Script(text, patient=True)
    talk(folder, script, lambda: inventory(**other))
    return toml_data((folder / "answers.toml").read_text(), "answers"), script


def changed(old: str, new: str, text: str = JET) -> str:
    assert old in text
    return text.replace(old, new, 1)


def test_what_is_answered_is_what_a_file_of_answers_holds(tmp_path):
    answers, script = answered(tmp_path / "lab", JET)
    assert answers["room"] == ["4 m", "3 m", "270 cm"]
    camera = answers["camera"]
    assert (camera["device"], camera["bits"], camera["width_px"]) == ("/dev/video7", 12, 1920)
    assert (camera["angle_of_view"], camera["frames"]) == ("59 deg", 50)
    assert "focal_length" not in camera
    (supply,) = answers["supply"]
    assert (supply["flow"], supply["lower"], supply["upper"]) == (
        "180 m3/h",
        ["1.2 m", "2.3 m"],
        ["1.8 m", "2.5 m"],
    )
    assert "temperature" not in answers["outlet"][0]
    assert script.refused == []
    assert any("the camera sees 4.53 x 2.83 m of a wall of 4 x 2.7 m" in told for told in script.told)
    assert any("It is in use." in told for told in script.told)
    assert {path.name for path in (tmp_path / "lab").iterdir()} == {
        "answers.toml",
        "boundary",
        "experiment.toml",
    }


WRONG = [
    ("\n3\n270 cm", "\n3000 m\n3\n270 cm", "millimetres"),
    ("\n20 C", "\n293 C\n20 C", "looks like kelvin"),
    ("/dev/video7", "/dev/video8\n/dev/video7", "none of them"),
    ("180 m3/h", "180 m3\n180 m3/h", "no unit of volume flow"),
    ("\n2.5\n", "\n2.9\n2.5\n", "is not on x_min"),
    ("\n1\nx_min", "\ntwo\n1\nx_min", "no whole number"),
    ("0.3\n1\nx_max", "0.3\n0\n1\nx_max", "must leave"),
    ("59 deg", "400 deg\n59 deg", "1 to 170 degrees"),
    ("\n1.5\n1.1", "\n15\n1.5\n1.1", "outside the room"),
]


@pytest.mark.parametrize(("old", "new", "sentence"), WRONG)
def test_a_wrong_answer_is_told_at_once_and_asked_again(old, new, sentence, tmp_path):
    answers, script = answered(tmp_path / "lab", changed(old, new))
    assert len(script.refused) == 1
    assert sentence in script.refused[0]
    right, _ = answered(tmp_path / "other", JET)
    assert answers == right
    with pytest.raises(BadInputError, match=f"standard input, line .*{sentence}"):
        talk(tmp_path / "piped", Piped(iter(changed(old, new).splitlines(keepends=True)).__next__), inventory)
    assert not (tmp_path / "piped" / "experiment.toml").exists()


def test_an_outlet_on_a_supply_is_asked_for_again_as_a_whole(tmp_path):
    on_it = "x_min\n1.2\n1.8\n2.4\n2.6\nnone\n"
    answers, script = answered(tmp_path / "lab", changed("x_max\n", f"{on_it}x_max\n"))
    assert len(script.refused) == 1
    assert "overlaps supply 1 on x_min" in script.refused[0]
    assert answers["outlet"][0]["wall"] == "x_max"


def test_of_several_outlets_each_is_asked_for_its_flow(tmp_path):
    one = "x_max\n1.2\n1.8\n0.1\n0.3\n"
    two = f"2\n{one}none\nnone\nz_max\n1\n1.4\n1\n1.4\n60\nnone\n"
    answers, script = answered(tmp_path / "lab", changed(f"1\n{one}none\n", two))
    assert script.refused == []
    assert [item.get("flow") for item in answers["outlet"]] == [None, "60 m3/h"]


# In place of "no objects": a ready one, and a box of its own size and heat.
NO_OBJECTS, OBJECTS = "none\n0\n0\n0\n", "none\n0\n0\n{}"
SECOND = """\
1
camera
right
x_max
/dev/video0
/dev/video2
8 mm
3.45 um
1280
960
3.5
projector
5
1
1
2
40
1920
1200
none
no
"""


def test_a_further_camera_is_asked_for_and_each_slip_is_told_where_it_was_made(tmp_path):
    text = JET.replace("/dev/video7", "/dev/video0").removesuffix("0\n") + SECOND
    first = replace(CAMERA, device="/dev/video0")
    told, script = answered(tmp_path / "lab", text, cameras=(first,))
    slips = ("another camera is called 'camera'", "the device of 'camera'", "at or behind the wall x_max")
    for slip, refused in zip(slips, script.refused, strict=True):
        assert slip in refused
    (view,) = told["view"]
    assert (view["name"], view["wall"], view["distance"]) == ("right", "x_max", "3.5 m")
    assert script.told[-1].startswith("the camera sees")
    scene = open_experiment(tmp_path / "lab").settings.scene
    assert [one.wall for one in scene.views] == ["y_max", "x_max"]


PERSON, BOX = "seated_person\n2\n1\n0\n", "box\n50 cm\n0.4\n30 cm\n1\n2.5\n0.2 m\n"


@pytest.mark.parametrize(
    ("heat", "known", "thermal"),
    [
        ("adiabatic\n", {}, "adiabatic"),
        ("temperature\n35\n1 K\n", {"temperature": "35 C", "temperature_deviation": "1 K"}, "temperature"),
        ("heat\n120\n20 W\n", {"heat": "120 W", "heat_deviation": "20 W"}, "power"),
        ("heat\n-0.05 kW\n\n", {"heat": "-0.05 kW", "heat_deviation": "15 W"}, "power"),
    ],
)
def test_a_person_and_a_box_are_asked_with_what_is_known_of_them(heat, known, thermal, tmp_path):
    answers, script = answered(
        tmp_path / "lab", changed(NO_OBJECTS, OBJECTS.format(f"2\n{PERSON}{BOX}{heat}"))
    )
    assert script.refused == []
    person, box = answers["object"]
    assert person == {"kind": "seated_person", "position": ["2 m", "1 m", "0 m"]}
    place = {"position": ["1 m", "2.5 m", "0.2 m"], "size": ["50 cm", "0.4 m", "30 cm"]}
    assert box == {"kind": "box"} | place | known
    kept = open_experiment(tmp_path / "lab").settings.scene.objects
    assert [item.name for item in kept] == ["seated person 1", "box 2"]
    assert kept[1].thermal == thermal


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("seated_person", "piano\nseated_person", "none of them"),
        ("\n2\n1\n0\n", "\n20\n2\n1\n0\n", "reaches from 19.8 to 20.2 m along x"),
        ("\n2\n1\n0\n", "\n2\n1\n2 m\n0\n", "reaches from 2 to 3.2 m along z"),
        ("50 cm", "50 m\n50 cm", "more than the room's 4 m"),
        ("50 cm", "5 W\n50 cm", "no unit of length"),
        ("120", "120 K\n120", "no unit of power"),
        ("20 W", "0 W\n20 W", "A deviation is 0.1 W"),
        # A whole object again: it stands in the person, or against the supply.
        ("box", "box\n\n\n\n2\n1\n\n\nbox", "it stands in object 1"),
        ("box", "box\n\n\n\n0.25\n1.5\n2.2\n\nbox", "it stands against supply 1 on x_min"),
    ],
)
def test_a_wrong_answer_on_an_object_is_told_at_once_and_asked_again(old, new, sentence, tmp_path):
    objects = f"2\n{PERSON}{BOX}heat\n120\n20 W\n"
    text = changed(NO_OBJECTS, OBJECTS.format(changed(old, new, objects)))
    answers, script = answered(tmp_path / "lab", text)
    assert len(script.refused) == 1
    assert sentence in script.refused[0]
    right, _ = answered(tmp_path / "right", changed(NO_OBJECTS, OBJECTS.format(objects)))
    assert answers == right


def test_a_ready_one_that_is_larger_than_the_room_is_chosen_again(tmp_path):
    low = changed("270 cm", "170 cm").replace("2.3\n2.5\n", "1.3\n1.5\n")
    answers, script = answered(
        tmp_path / "lab", changed(NO_OBJECTS, OBJECTS.format("1\nstanding_person\ndesk\n2\n1\n0\n"), low)
    )
    assert len(script.refused) == 1
    assert "it is 1.75 m long along z, more than the room's 1.7 m" in script.refused[0]
    assert answers["object"][0]["kind"] == "desk"


def test_back_asks_the_question_before_again(tmp_path):
    answers, _ = answered(tmp_path / "lab", changed("A lab\n4 m\n3\n", "A lab\n4 m\nback\n5 m\n3 m\n"))
    assert answers["room"][:2] == ["5 m", "3 m"]


def test_an_interrupted_conversation_goes_on_where_it_was_and_can_be_begun_anew(tmp_path):
    folder, lines = tmp_path / "lab", JET.splitlines(keepends=True)
    with pytest.raises(EOFError, match="supply 1: temperature"):
        talk(folder, Script("".join(lines[:20])), inventory)
    assert [path.name for path in folder.iterdir()] == [DRAFT_FILE]
    with pytest.raises(BadInputError, match="neither; expected 'go on' or 'begin anew'"):
        talk(folder, Script(JET), inventory)
    talk(folder, Script("go on\n" + "".join(lines[20:])), inventory)
    whole, _ = answered(tmp_path / "whole", JET)
    assert toml_data((folder / "answers.toml").read_text(), "answers") == whole
    again = tmp_path / "again"
    with pytest.raises(EOFError):
        talk(again, Script("".join(lines[:20])), inventory)
    # The draft is itself a pipe of answers.
    kept = (again / DRAFT_FILE).read_text()
    talk(again, Script("begin anew\n" + kept + "".join(lines[20:])), inventory)
    assert toml_data((again / "answers.toml").read_text(), "answers") == whole


def test_a_camera_that_is_gone_when_the_conversation_goes_on_is_asked_for_again(tmp_path):
    folder = tmp_path / "lab"
    with pytest.raises(EOFError):
        talk(folder, Script("".join(JET.splitlines(keepends=True)[:12])), inventory)
    with pytest.raises(EOFError, match="The room that it looks at"):
        talk(folder, Script("go on\nsimulated\n"), lambda: inventory(cameras=(SIMULATED,)))


def test_a_projectors_port_is_asked_who_is_there(tmp_path):
    twin = make_twin("benq", clock=SystemClock())
    with PtyHost(twin, tmp_path / "port") as host:
        device = str(host.path)
        thrown = f"projector\n3 m\n-1 m\n1.3 m\n40 deg\n1920\n1200\n{device}\n\n"
        answers, script = answered(
            tmp_path / "lab",
            changed("print\n", thrown).replace("\n50\n", "\n50\nno\n"),
            ports=(FoundPort(device, "a port"),),
            who=who_is_there,
        )
    assert answers["projector"]["url"] == f"benq:{device}"
    assert any(device in told and "standby" in told for told in script.told)


# The wall has a projector; a further one is asked for, and another, each with a slip.
FIRST_THROWN = "projector\n3 m\n-1 m\n1.3 m\n40 deg\n1920\n1200\naddress\npjlink://10.0.0.1\n"
LIGHTS = """\
yes
camera
from the left
1
5
-1
2
45
1024
768
address
pjlink://10.0.0.1
pjlink://10.0.0.2
yes

2 m





none
no
"""


def test_further_projectors_are_asked_for_and_each_slip_is_told_where_it_was_made(tmp_path):
    text = changed("print\n", FIRST_THROWN).removesuffix("0\n") + LIGHTS + "0\n"
    told, script = answered(tmp_path / "lab", text)
    slips = ("another camera is called 'camera'", "at or behind the wall y_max", "its own address")
    for slip, refused in zip(slips, script.refused, strict=True):
        assert slip in refused
    left, middle = told["light"]
    assert (left["name"], left["camera_of"], left["url"]) == ("from the left", "camera", "pjlink://10.0.0.2")
    assert (left["position"], left["angle_of_view"]) == (["1 m", "-1 m", "2 m"], "45 deg")
    # What is not answered is as the first one's; where it is spoken to is its own.
    assert (middle["name"], middle["position"]) == ("projector 3", ["2 m", "-1 m", "1.3 m"])
    assert "url" not in middle
    views = open_experiment(tmp_path / "lab").settings.scene.views
    assert [(view.name, view.camera_of) for view in views] == [
        ("camera", None),
        ("from the left", "camera"),
        ("projector 3", "camera"),
    ]


def test_a_further_projector_before_a_further_camera_is_that_cameras(tmp_path):
    second = SECOND.replace("1\ncamera\n", "1\n", 1).replace("/dev/video0\n", "").replace("\n5\n", "\n")
    further = "yes\nabove\n\n\n2.5\n\n\n\nnone\nno\n"
    text = JET.removesuffix("0\n") + second.removesuffix("no\n") + further
    told, script = answered(tmp_path / "lab", text)
    assert script.refused == []
    assert told["light"][0]["camera_of"] == "right"
    views = open_experiment(tmp_path / "lab").settings.scene.views
    assert [(view.name, view.wall, view.camera_of) for view in views[1:]] == [
        ("right", "x_max", None),
        ("above", "x_max", "right"),
    ]


def test_a_real_pipe_makes_the_experiment_and_a_wrong_line_says_its_number(tmp_path):
    done = subprocess.run(
        [*AIRLENS, "lab"],
        input="simulated\n" + 100 * "\n",
        text=True,
        capture_output=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "the camera sees 5.41 x 4.06 m" in done.stdout
    assert "Next: airlens plan lab" in done.stdout
    made = toml_data((tmp_path / "lab" / "answers.toml").read_text(), "answers")
    packaged = toml_data(template(SAMPLE), SAMPLE)
    assert {key: made[key] for key in ("room", "air", "camera")} == {
        k: packaged[k] for k in ("room", "air", "camera")
    }
    assert "object" not in made
    wrong = subprocess.run(
        [*AIRLENS, "other"],
        input="simulated\nsample\n\n4 ells\n",
        text=True,
        capture_output=True,
        cwd=tmp_path,
        check=False,
    )
    assert wrong.returncode == 2
    assert "line 4, the answer to 'Length along x': 'ells' is no unit of length" in wrong.stderr


def test_a_real_pipe_makes_a_room_with_a_person_and_a_box(tmp_path):
    before = "simulated\n" + "\n" * _defaults_before("How many people", tmp_path / "count")
    objects = "2\nseated_person\n2 m\n1 m\n0 m\nbox\n0.5\n0.5\n0.3\n1\n2.5\n0\nheat\n120\n20\n"
    done = subprocess.run(
        [*AIRLENS, "lab"],
        input=before + objects + 100 * "\n",
        text=True,
        capture_output=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    person, box = open_experiment(tmp_path / "lab").settings.scene.objects
    assert (person.name, person.power_w) == ("seated person 1", 75.0)
    assert (box.name, box.power_w, box.power_std_w) == ("box 2", 120.0, 20.0)


def _defaults_before(question: str, folder: Path) -> int:
    """How many questions come between the camera and this one, in the packaged room."""
    with pytest.raises(_FoundError) as found:
        talk(folder, _Counting(question), lambda: inventory(cameras=(SIMULATED,)))
    return found.value.args[0] - 1


class _FoundError(Exception):
    """So many questions were asked before the one that is looked for."""


class _Counting(Piped):
    def __init__(self, question: str) -> None:
        super().__init__(lambda: "\n")
        self.question, self.asked = question, 0

    def hear(self, question):
        if question.text.startswith(self.question):
            raise _FoundError(self.asked)
        self.asked += 1
        return super().hear(question)


def test_a_pipe_as_a_file_is_read(tmp_path):
    (tmp_path / "answers.toml").write_text(template(SAMPLE))
    command = f"{' '.join(map(repr, AIRLENS[:1]))} -c {AIRLENS[2]!r} new lab --from <(cat answers.toml)"
    done = subprocess.run(["bash", "-c", command], text=True, capture_output=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "lab" / "experiment.toml").is_file()


class Screen:
    """What a terminal shows, and hands that type."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [*AIRLENS, *words], stdin=slave, stdout=slave, stderr=slave, cwd=folder
        )
        os.close(slave)
        self.shown = ""

    def interrupt(self, until: str) -> None:
        """Ctrl-C, and again where the first came just before the program began to read."""
        for _ in range(5):
            self.process.send_signal(signal.SIGINT)
            try:
                return self.await_text(until, within_s=20)
            except AssertionError:
                continue
        raise AssertionError(self.shown)

    def await_text(self, text: str, within_s: float = 100) -> None:
        until_s = time.monotonic() + within_s
        while text not in self.shown and time.monotonic() < until_s:
            if select.select([self.master], [], [], 0.2)[0]:
                self.shown += os.read(self.master, 4096).decode()
        assert text in self.shown

    def type(self, line: str, until: str) -> None:
        self.shown = ""
        os.write(self.master, f"{line}\n".encode())
        self.await_text(until)


def test_at_a_terminal_questions_show_their_options_and_defaults_and_ctrl_c_keeps_the_answers(tmp_path):
    screen = Screen(tmp_path, "lab")
    screen.await_text("simulated  Simulated camera in the packaged room")
    screen.await_text("Camera [")
    screen.type("simulated", "The room that it looks at (an NPZ file, or sample) [sample]: ")
    screen.type("", "Name of the experiment [The packaged room]: ")
    screen.type("", "Length along x [4.1 m]: ")
    screen.type("4100 m", "millimetres")
    screen.type("4.1", "Depth along y [3 m]: ")
    screen.interrupt("goes on there")
    assert screen.process.wait(60) == 130
    os.close(screen.master)
    screen = Screen(tmp_path, "lab")
    screen.await_text("4 answers are kept; go on or begin anew [go on]: ")
    screen.type("", "Depth along y [3 m]: ")
    screen.process.kill()
    screen.process.wait()
    os.close(screen.master)
