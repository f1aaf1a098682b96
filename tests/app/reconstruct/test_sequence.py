"""A sequence through the product's own road: captured, reconstructed burst by burst, scored, exported."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from app.capture.burst import Order, take_order
from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.pipeline import reconstruct
from app.rig.open import open_camera
from app.simulate.experiment import simulate
from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_box
from app.volume.score import score_experiment
from drivers.burst import CapturePlan
from tests.rooms import ROOM

BURSTS, EVERY_S = 6, 5.0


def moving_air(folder: Path) -> Path:
    """The packaged room with blobs of air, 4 K warmer or colder across the view, that are elsewhere in each burst."""
    volume = read_volume(ROOM)
    room, count = room_box(volume), 24
    axes = [np.linspace(low, high, count) for low, high in zip(room.lower_m, room.upper_m, strict=True)]
    x, _, z = np.meshgrid(*axes, indexing="ij")
    rng = np.random.default_rng(2)
    size_m = np.array(room.size_m)[[0, 2]]
    air = []
    for _ in range(BURSTS):
        blobs = np.zeros_like(x)
        for sign in (4.0, -4.0, 4.0, -4.0):
            at = np.array(room.lower_m)[[0, 2]] + size_m * rng.uniform(0.2, 0.8, 2)
            blobs += sign * np.exp(-((x - at[0]) ** 2 + (z - at[1]) ** 2) / (2 * 0.25**2))
        air.append(blobs)
    shown = [np.linspace(0, n - 1, count).round().astype(int) for n in volume.temperature_k.shape]
    still_k = volume.temperature_k[np.ix_(*shown)] - volume.ambient_k
    path = folder / "moving.npz"
    np.savez(
        path,
        time_s=EVERY_S * np.arange(BURSTS),
        **dict(zip("xyz", axes, strict=True)),
        T=(still_k + np.stack(air)).astype(np.float32),
        T0=np.array(volume.ambient_k),
    )
    return path


@pytest.fixture(scope="module")
def captured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sequence")
    settings = SimulatedCameraSettings(noise_free=True, frame_rate_hz=4.0)
    options = RigOptions(camera_px=(192, 144), frames=2)
    experiment = simulate(
        ROOM, folder / "room", options, "operator", settings, snapshots_path=moving_air(folder)
    )
    with open_camera(open_experiment(experiment), "moving") as camera:
        plan = CapturePlan(role="flow", frames=4, settle_frames=0)
        taken = take_order(camera, open_experiment(experiment), Order(plan, BURSTS, EVERY_S))
    assert len(taken) == BURSTS
    return experiment


def test_bursts_are_found_nearer_than_by_their_mean(captured):
    done = reconstruct(captured, "draft", sequence=True)
    with xr.open_dataset(done.folder / "result.nc", engine="h5netcdf") as dataset:
        assert dataset.sizes["time"] == BURSTS
        assert np.isfinite(dataset["T_departure"]).all()
    scores = score_experiment(captured, captured / "truth.npz", done.folder)["bursts"]
    # Blobs as deep as the room are seen, though the belief is in air that is alike in all directions.
    assert scores["departure_rel"] < 0.8
    assert scores["rms_K"] < scores["mean_rms_K"]
    assert scores["within"] > 0.85
    assert any("From burst to burst" in note for note in done.solution.notes)
    alone = reconstruct(captured, "draft")
    assert alone.solution.departures is None
    np.testing.assert_array_equal(alone.solution.temperature_k, done.solution.temperature_k)
    assert score_experiment(captured, captured / "truth.npz", alone.folder)["bursts"] is None


def test_one_burst_is_no_sequence(captured, tmp_path):
    experiment = simulate(
        ROOM,
        tmp_path / "room",
        RigOptions(camera_px=(96, 72), frames=1),
        "operator",
        SimulatedCameraSettings(),
    )
    with pytest.raises(BadInputError, match="--bursts 16"):
        reconstruct(experiment, "draft", sequence=True)
    assert not list((experiment / "results").glob("*"))
