import numpy as np
import xarray as xr

from app.experiment.results import read_result, write_result
from app.report.figures import as_png, volume_figure
from core.result import Outcome, Solution

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


def test_where_the_measurements_speak_is_drawn():
    drawn = volume_figure(solution(), solution().informed, "informed", highest=1.0)
    assert as_png(drawn).startswith(b"\x89PNG")
    # Three planes and the colour bar.
    assert len(drawn.axes) == 4
