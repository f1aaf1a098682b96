from dataclasses import replace

import numpy as np
import xarray as xr

from app.experiment.results import read_result, write_result
from app.report.figures import as_png, volume_figure
from core.result import Departures, Outcome, Solution

SHAPE = (3, 4, 5)


def solution() -> Solution:
    rng = np.random.default_rng(3)
    volumes = [rng.uniform(0.1, 0.9, SHAPE).astype(np.float32).astype(float) for _ in range(4)]
    vectors = [rng.uniform(0.1, 0.9, (*SHAPE, 3)).astype(np.float32).astype(float) for _ in range(2)]
    return Solution(
        np.linspace(0.0, 1.0, 3),
        np.linspace(0.0, 2.0, 4),
        np.linspace(0.0, 3.0, 5),
        293.0 + volumes[0],
        volumes[1],
        vectors[0],
        volumes[2],
        volumes[3],
        vectors[1],
        volumes[0],
        outcome=Outcome.step_limit,
        notes=("One.", "Two."),
    )


def test_everything_that_a_solver_says_comes_back_from_disk(tmp_path):
    written = solution()
    write_result(tmp_path / "result.nc", written, {"title": "room"})

    found = read_result(tmp_path / "result.nc")

    for name in (
        "pressure_m2_s2",
        "velocity_m_s",
        "temperature_std_k",
        "pressure_std_m2_s2",
        "velocity_std_m_s",
        "informed",
    ):
        np.testing.assert_array_equal(getattr(found, name), getattr(written, name))
    np.testing.assert_allclose(found.temperature_k, written.temperature_k, rtol=1e-7)
    assert found.outcome is Outcome.step_limit
    assert found.notes == ("One.", "Two.")
    with xr.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as data:
        assert data["informed"].attrs["units"] == "1"


def test_errors_that_all_places_share_come_back(tmp_path):
    shared_k = np.stack([solution().temperature_std_k, -solution().temperature_std_k], axis=-1) / 2
    write_result(tmp_path / "result.nc", replace(solution(), temperature_shared_k=shared_k), {})

    found = read_result(tmp_path / "result.nc")

    np.testing.assert_array_equal(found.temperature_shared_k, shared_k)


def test_where_the_measurements_speak_is_drawn():
    drawn = volume_figure(solution(), solution().informed, "informed", highest=1.0)
    assert as_png(drawn).startswith(b"\x89PNG")
    # Three planes and the colour bar.
    assert len(drawn.axes) == 4


def with_bursts() -> Solution:
    rng = np.random.default_rng(4)
    departures = Departures(
        np.array([0.0, 6.0, 12.0]),
        rng.uniform(-0.5, 0.5, (3, *SHAPE)).astype(np.float32),
        rng.uniform(0.1, 0.2, SHAPE).astype(np.float32),
        field_std_k=0.25,
        field_length_m=0.5,
    )
    return replace(solution(), departures=departures)


def test_the_bursts_of_a_sequence_come_back_along_a_time_axis(tmp_path):
    written = with_bursts()
    write_result(tmp_path / "result.nc", written, {"began": "2026-01-01 12:00:00"})

    found = read_result(tmp_path / "result.nc").departures

    assert found is not None
    for name in ("time_s", "temperature_k", "temperature_std_k"):
        np.testing.assert_array_equal(getattr(found, name), getattr(written.departures, name))
    assert (found.field_std_k, found.field_length_m) == (0.25, 0.5)
    with xr.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as dataset:
        assert dataset["T_departure"].dims == ("time", "x", "y", "z")
        assert dataset["time"].to_numpy()[1] == np.datetime64("2026-01-01T12:00:06")
        np.testing.assert_allclose(dataset["T_rms"], written.departures.rms_k)
