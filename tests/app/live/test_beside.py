"""T of single bursts beside a capture: the same T as the preset's, on the same road; what is missing is said."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.capture.burst import Order, take_order
from app.capture.watched import BurstWatch
from app.experiment.captures import newest_pair
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.live.__main__ import Newest
from app.live.beside import LiveAir, LiveState
from app.live.burst_draft import BurstDraft
from app.live.looking import Looking
from app.reconstruct.measure import measure
from app.reconstruct.presets import preset as preset_called
from app.reconstruct.presets import solved
from app.reconstruct.problem import known_of, problem_of
from app.rig.open import open_camera
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions
from core.watch import Watch
from drivers.burst import CapturePlan
from tests.rooms import ROOM, state_grid


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = RigOptions(camera_px=(160, 120), frames=2)
    found = simulate(
        ROOM, tmp_path_factory.mktemp("live") / "e", options, "operator", SimulatedCameraSettings()
    )
    state_grid(found, 12)
    return found


def test_t_of_a_burst_is_that_of_the_preset_draft(folder: Path):
    flow = open_experiment(folder).latest_capture("flow")

    seen = BurstDraft(folder).of(flow)

    experiment = open_experiment(folder)
    known, captures = known_of(experiment), newest_pair(experiment)
    measured = measure(captures, known.scene)
    problem = problem_of(replace(known, scene=measured.scene), measured.shifts)
    preset = solved(preset_called("draft"), problem, Watch())
    # The rays are those of more windows, of which these are chosen: sums in another order.
    np.testing.assert_allclose(seen.solution.temperature_k, preset.temperature_k, rtol=1e-5)
    assert 0.0 < seen.noise_k < np.ptp(preset.temperature_k)


def test_bursts_are_looked_at_beside_a_series_and_none_is_lost(folder: Path):
    experiment, told = open_experiment(folder), []
    beside = LiveAir(lambda kind, body: told.append((kind, body["state"])))
    try:
        with open_camera(experiment, "moving") as camera:
            watch = BurstWatch(kept=lambda kept: beside.look(folder, kept, "series"))
            order = Order(CapturePlan("flow", 2, settle_frames=0), bursts=3, every_s=0.2, live=True)
            began_s = time.monotonic()
            taken = take_order(camera, experiment, order, watch)
            took_s = time.monotonic() - began_s
        last = taken[-1].folder
        assert last is not None
        status = beside.wait(last.name, 200.0)
    finally:
        beside.close()
    assert [one.shortfall for one in taken] == ["", "", ""]
    # The first look takes seconds to begin; a capture that waited for it would too.
    assert took_s < 20.0
    assert status.state is LiveState.ready
    assert status.skipped < len(taken)
    assert status.plane is not None
    assert status.plane.capture == last.name
    low, high = status.plane.scale_k
    assert low < float(np.median(status.plane.kelvin)) < high
    assert ("live", "preparing") in told


def test_without_a_reference_it_says_what_to_take(folder: Path, tmp_path: Path):
    (tmp_path / "experiment.toml").write_bytes((folder / "experiment.toml").read_bytes())
    told = []

    Looking(told.append).carry_out(tmp_path, None, 0)

    assert told[-1]["state"] == "missing"
    assert told[-1]["reason"]


def test_of_bursts_that_wait_only_the_newest_is_taken_and_the_others_counted():
    newest = Newest()
    newest.put({"experiment": "e"})
    for capture in "abc":
        newest.put({"experiment": "e", "capture": capture})
    newest.put(None)

    assert newest.take() == ({"experiment": "e", "capture": "c"}, 2)
    assert newest.take() is None
