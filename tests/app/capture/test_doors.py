"""A quantity has one name: the flag's, the request's, the manifest's. A capture says the same whoever asked."""

import json
from dataclasses import fields
from typing import Any, get_args

import pytest
from typer.testing import CliRunner

from app.api.models.captures import NewCapture, Role
from app.api.models.guide import GuideRequest
from app.api.resources.captures import order_of
from app.capture.burst import Order
from app.capture.service import CaptureDesk
from app.cli import create_cli
from app.commands import COMMANDS
from app.commands.calibrate import STEPS
from app.commands.lazy import commands_of
from app.experiment.captures import load_capture
from app.experiment.folder import Experiment, finished
from app.rig.conditions import Conditions
from app.rig.live_cameras import LiveCameras
from app.simulate.rehearsal import Rehearsal, rehearse
from drivers.burst import CapturePlan, CaptureRole

PLAN = {field.name for field in fields(CapturePlan)}
STATED = {field.name for field in fields(Conditions)}
# `at_once` is kept of captures of several views: tests/app/capture/test_views.py. `live` is for the eye alone.
ORDER = {field.name for field in fields(Order)} - {"plan", "told"}
# What only a shell has: where to look, how to print, what Ctrl-C does.
SHELL = {"experiment", "as_json", "on_abort", "help"}


def options_of(*path: str) -> dict[str, Any]:
    """A command's options by the names of their fields."""
    first, *rest = path
    if first == "calibrate":
        command: Any = commands_of(STEPS[rest[0]][0])[rest[0]]
    else:
        command = commands_of(COMMANDS[first][0])[first]
        for name in rest:
            command = command.commands[name]
    return {p.name: p for p in command.params if p.param_type_name == "option"}


@pytest.mark.parametrize("role", ["reference", "flow", "dark", "flat"])
def test_flags_request_and_plan_have_the_same_names(role):
    flags = options_of("capture", role)
    assert set(flags) - SHELL == set(NewCapture.model_fields) - {"role"}
    assert set(NewCapture.model_fields) == PLAN | STATED | ORDER
    assert get_args(Role) == get_args(CaptureRole)


@pytest.mark.parametrize(
    "path",
    [("capture", "flow"), ("capture", "watch"), ("preview",)]
    + [("calibrate", step) for step in ("camera", "projector", "wall", "response")],
)
def test_a_flag_is_the_name_of_its_field(path):
    for name, option in options_of(*path).items():
        if name not in SHELL:
            assert f"--{name.replace('_', '-')}" in option.opts


def test_a_guided_step_has_the_same_names_on_the_command_line():
    flags = {
        name for step in ("camera", "projector", "wall", "response") for name in options_of("calibrate", step)
    }
    assert set(GuideRequest.model_fields) - {"step", "board"} <= flags


def test_defaults_are_the_same_at_every_door():
    request = NewCapture(role="flow")
    flags = options_of("capture", "flow")
    assert order_of(request) == Order(CapturePlan(role="flow"))
    for name in set(NewCapture.model_fields) - {"role"}:
        assert flags[name].default == getattr(request, name), name


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return rehearse(tmp_path_factory.mktemp("doors"), Rehearsal(camera_px=96))


ASKED = {"frames": 3, "settle_frames": 0, "exposure_s": 0.015, "gain": 2.0, "settle_s": 0.1, "max_refused": 9}
ASKED |= {"refresh_hz": 60.0, "raw_stack": True, "bursts": 2, "every_s": 0.5}
ASKED |= {"ambient_temperature_k": 291.5, "minutes_on": 7.0}


def by_shell(experiment: Experiment) -> None:
    words = [f"--{name.replace('_', '-')}={value}" for name, value in ASKED.items() if name != "raw_stack"]
    line = ["capture", "reference", str(experiment.folder), "--raw-stack", *words]
    done = CliRunner().invoke(create_cli(), line)
    assert done.exit_code == 0, done.output


def by_service(experiment: Experiment) -> None:
    live = LiveCameras(lambda kind, body: None)
    desk = CaptureDesk(live, lambda kind, body: None)
    try:
        desk.start(experiment, order_of(NewCapture.model_validate(ASKED | {"role": "reference"})))
        desk.wait(200)
        assert (desk.status.state, desk.status.burst, desk.status.reason) == ("finished", 2, "")
    finally:
        live.close()


def test_a_capture_says_what_was_asked_and_stated_by_the_same_names_whoever_asked(experiment):
    said = []
    for asks in (by_shell, by_service):
        before = set(finished(experiment.captures_folder))
        asks(experiment)
        taken = sorted(set(finished(experiment.captures_folder)) - before)
        assert len(taken) == 2
        manifests = [load_capture(folder).manifest for folder in taken]
        for manifest in manifests:
            plan, origin = manifest["views"][0]["plan"], manifest["origin"]
            written = {name: plan[name] for name in PLAN} | {name: origin[name] for name in STATED}
            written |= {name: origin["sequence"][name] for name in ORDER - {"at_once", "live"}}
            assert written == ASKED | {"role": "reference"}
            assert manifest["raw"]["file"] == "frames.tif"
            warm_up = [v for v in manifest["views"][0]["verdicts"] if v["name"] == "warm-up"]
            assert [v["value"] for v in warm_up] == [420.0]
        said.append([m["origin"] | {"sequence": m["origin"]["sequence"]["number"]} for m in manifests])
    assert said[0] == said[1]
    assert json.loads(json.dumps(said[0][0]))["rig"] == "simulated"
    assert said[0][0]["air"] == "still"
