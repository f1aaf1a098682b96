"""Maps of draught, warmth and age: by hand, their intervals, and the same numbers wherever they go."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from app.experiment.results import read_derived, read_result, to_dataset, write_result
from app.report.export import _write_csv
from app.report.maps import derived_maps, ends
from core.comfort import draught_rate_percent
from core.result import Derived
from core.scene import Inlet, Outlet, Patch
from tests.app.report.test_indoor import PLUG_ROOM, layered


@pytest.fixture(scope="module")
def maps() -> dict[str, Derived]:
    return {one.name: one for one in derived_maps(layered(deviation=0.01), PLUG_ROOM)}


def test_each_map_holds_its_found_values(maps):
    assert set(maps) == {"speed", "draught_rate", "pmv", "ppd", "age"}
    for one in maps.values():
        assert one.low is not None
        assert (one.low <= one.values + 1e-9).all(), one.name
        assert (one.values <= one.high + 1e-9).all(), one.name


def test_draught_and_speed_are_those_of_the_place(maps):
    found = layered()
    speed = np.linalg.norm(found.velocity_m_s, axis=-1)
    np.testing.assert_allclose(maps["speed"].values, speed)
    np.testing.assert_allclose(maps["draught_rate"].values, draught_rate_percent(found.temperature_k, speed))


def test_the_interval_of_the_speed_is_that_of_its_component(maps):
    # 0.1 m/s along x with 0.01 m/s on each component: 1.96 deviations each way, the others hardly count.
    half = 0.5 * (maps["speed"].high - maps["speed"].low)
    np.testing.assert_allclose(half, 0.0196, rtol=0.12)


def test_the_interval_of_the_vote_follows_temperature(maps):
    # About 0.25 votes a kelvin for these clothes, 0.05 K of deviation, and the little that speed adds at 0.1 m/s.
    half = 0.5 * (maps["pmv"].high - maps["pmv"].low)
    assert 0.02 < half.mean() < 0.12


def test_the_age_in_a_plug_grows_with_the_way(maps):
    age_s = 60.0 * maps["age"].values[:, 3, 3]
    x_m = layered().x_m
    inner = (x_m > 0.3) & (x_m < 3.7)
    # Upwind cells are half a cell too old, 0.1 m of 20 cells, and eddies spread a little.
    np.testing.assert_allclose(age_s[inner], x_m[inner] / 0.1, atol=2.5)


def test_an_age_of_which_hardly_anything_is_known_is_there_with_its_interval():
    supply, exhaust = (
        Patch(wall=wall, lower_m=(at_m, at_m), upper_m=(at_m + 0.3, at_m + 0.3))
        for wall, at_m in (("x_min", 0.05), ("x_max", 1.65))
    )
    openings = Inlet(patch=supply, temperature_k=290.0, velocity_m_s=(0.1, 0.0, 0.0)), Outlet(patch=exhaust)
    # 0.1 m/s known to 0.3 m/s: in two of 16 samples air leaves by both openings, and nothing is changed.
    found = derived_maps(layered(deviation=0.3), replace(PLUG_ROOM, boundary=openings))
    (age,) = (one for one in found if one.name == "age")

    assert (age.low <= age.values + 1e-9).all()
    assert age.high.min() > 100 * age.values.max()


def test_without_velocity_there_are_no_maps():
    assert derived_maps(replace(layered(), velocity_m_s=None), PLUG_ROOM) == ()


def test_without_deviations_there_are_no_intervals():
    assert {one.low for one in derived_maps(layered(), PLUG_ROOM)} == {None}


def test_where_draws_lie_to_one_side_both_intervals_are_held():
    low, high = ends(np.array([1.0]), np.array([[1.5], [2.0], [2.5]]))
    # From the draws 1.525 to 2.475; moved by -1, so that their median is 1: 0.525 to 1.475.
    assert (low[0], high[0]) == (pytest.approx(0.525), pytest.approx(2.475))


def test_maps_come_back_from_the_file_and_leave_the_solution_as_it_is(tmp_path, maps):
    write_result(tmp_path / "result.nc", layered(deviation=0.01), {}, tuple(maps.values()))
    kept = {one.name: one for one in read_derived(tmp_path / "result.nc")}
    assert set(kept) == set(maps)
    np.testing.assert_allclose(kept["pmv"].high, maps["pmv"].high, rtol=1e-6)
    assert kept["age"].unit == "min"
    assert read_result(tmp_path / "result.nc").temperature_std_k is not None


def test_a_table_has_a_column_for_each_map_and_end(tmp_path, maps):
    _write_csv(tmp_path / "air.csv", layered(deviation=0.01), tuple(maps.values()))
    table = pd.read_csv(tmp_path / "air.csv")
    assert {"draught_rate [%]", "draught_rate_low [%]", "pmv_high [1]", "age [min]"} <= set(table.columns)
    dataset = to_dataset(layered(), {}, tuple(maps.values()))
    assert dataset["draught_rate"].attrs["units"] == "%"
