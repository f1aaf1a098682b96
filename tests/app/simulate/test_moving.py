"""A simulated room whose air moves: each frame sees the air of its moment."""

from pathlib import Path

import numpy as np
import pytest

from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.rig.open import open_camera
from app.simulate.experiment import simulate
from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_box
from tests.rooms import ROOM


def moving_air(folder: Path, reach: float = 1.0) -> Path:
    """Still air, and 3 s later air that is warmer by 60 K a metre of height."""
    room = room_box(read_volume(ROOM))
    x, y, z = (
        np.linspace(low, reach * high, 6) for low, high in zip(room.lower_m, room.upper_m, strict=True)
    )
    layers = np.broadcast_to((60.0 * (z - z[0])).astype(np.float32), (6, 6, 6))
    excess_k = np.stack([np.zeros_like(layers), layers])
    path = folder / "moving.npz"
    np.savez(
        path, time_s=np.array([0.0, 3.0]), x=x, y=y, z=z, T=excess_k, T0=np.array(read_volume(ROOM).ambient_k)
    )
    return path


def test_each_frame_sees_the_air_of_its_moment(tmp_path: Path):
    settings = SimulatedCameraSettings(noise_free=True, frame_rate_hz=0.5)
    options = RigOptions(camera_px=(96, 72), frames=2)
    folder = simulate(
        ROOM, tmp_path / "room", options, "operator", settings, snapshots_path=moving_air(tmp_path)
    )
    experiment = open_experiment(folder)
    with open_camera(experiment, "still", moment=0) as camera:
        still = camera.grab().pixels
    # Frames begin every 2 s; the record is 3 s and its own step long, and begins again.
    with open_camera(experiment, "moving", moment=0) as camera:
        frames = [camera.grab().pixels for _ in range(4)]
    for one, same in ((frames[0], still), (frames[1], frames[2]), (frames[3], frames[0])):
        np.testing.assert_allclose(one.astype(float), same, atol=3.0)
    assert np.abs(frames[1].astype(float) - frames[0]).max() > 30.0


def test_snapshots_of_another_room_leave_no_experiment(tmp_path: Path):
    with pytest.raises(BadInputError, match="another room"):
        simulate(
            ROOM,
            tmp_path / "room",
            RigOptions(camera_px=(96, 72), frames=1),
            "operator",
            SimulatedCameraSettings(),
            snapshots_path=moving_air(tmp_path, reach=1.5),
        )
    assert not (tmp_path / "room").exists()
