"""Snapshots of moving air: which one a moment has, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from app.errors import BadInputError
from app.volume.snapshots import read_snapshots
from core.geometry import Box

ROOM = Box(lower_m=(0.0, -1.0, 0.0), upper_m=(4.0, 1.0, 2.5))


def good() -> dict[str, np.ndarray]:
    x, y, z = (
        np.linspace(low, high, n) for low, high, n in zip(ROOM.lower_m, ROOM.upper_m, (5, 4, 3), strict=True)
    )
    excess_k = np.arange(3 * 5 * 4 * 3, dtype=np.float32).reshape(3, 5, 4, 3) / 100
    return {"time_s": np.array([2.0, 5.0, 8.0]), "x": x, "y": y, "z": z, "T": excess_k, "T0": np.array(293.0)}


def saved(folder: Path, arrays: dict[str, np.ndarray]) -> Path:
    np.savez(folder / "moving.npz", **arrays)
    return folder / "moving.npz"


def test_temperatures_are_absolute_and_time_begins_at_the_first(tmp_path):
    found = read_snapshots(saved(tmp_path, good()), ROOM)
    np.testing.assert_allclose(found.temperature_k, 293.0 + good()["T"], rtol=1e-6)
    assert found.time_s.tolist() == [0.0, 3.0, 6.0]


def test_a_moment_has_the_nearest_snapshot_and_the_record_begins_again(tmp_path):
    found = read_snapshots(saved(tmp_path, good()), ROOM)
    assert [found.nearest(t) for t in (0.0, 1.4, 1.6, 6.0, 8.9, 9.0, 12.1)] == [0, 0, 1, 2, 2, 0, 1]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"time_s": np.array([2.0, 2.0, 8.0])}, "increasing moments"),
        ({"time_s": np.array([2.0, 5.0])}, "T has shape"),
        ({"x": np.linspace(0.0, 5.0, 5)}, "another room"),
        ({"z": np.array([0.0, 0.1, 2.5])}, "evenly spaced"),
        ({"T": np.full((3, 5, 4, 3), np.nan, np.float32)}, "not finite"),
    ],
)
def test_what_does_not_fit_the_room_is_refused(tmp_path, changed, words):
    with pytest.raises(BadInputError, match=words):
        read_snapshots(saved(tmp_path, {**good(), **changed}), ROOM)


def test_a_file_without_temperatures_is_refused(tmp_path):
    arrays = good()
    del arrays["T"]
    with pytest.raises(BadInputError, match="has no T;"):
        read_snapshots(saved(tmp_path, arrays), ROOM)
    with pytest.raises(BadInputError, match="There are no snapshots"):
        read_snapshots(tmp_path / "absent.npz", ROOM)
