"""The figures for people and ventilation: by hand where they can be, with intervals, and what lacks is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.experiment.folder import ExperimentSettings, create_experiment, write_manifest
from app.experiment.results import write_result
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.report.finding import read_finding
from app.report.indoor import NAMES, IndoorAsked, Quantity, age_of_air, indoor, told
from app.report.page import render_report
from core.comfort import Occupant
from core.geometry import Box, looking_along_y
from core.occupied import OccupiedZone
from core.result import Solution
from core.scene import FixedTexture, Inlet, Outlet, Scene, View
from core.setting import SettingError
from tests.core.ventilation.rooms import INLET, OUTLET, box, packaged, plug

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.0))
VIEW = View(camera=looking_along_y(position_m=(2.0, -5.0, 1.0), width_px=64, height_px=48, focal_px=100.0))
PLUG_ROOM = Scene(room=ROOM, views=(VIEW,), light=FixedTexture())
OPENINGS = (Inlet(patch=INLET, temperature_k=290.0, velocity_m_s=(0.2, 0.0, 0.0)), Outlet(patch=OUTLET))


def layered(cells: int = 20, deviation: float | None = None) -> Solution:
    """A plug of 0.1 m/s, 2 K warmer a metre higher, 295 K at the floor."""
    found = plug(cells)
    temperature_k = 295.0 + 2.0 * np.broadcast_to(found.z_m, found.temperature_k.shape)
    found = replace(found, temperature_k=temperature_k)
    if deviation is None:
        return found
    return replace(
        found,
        temperature_std_k=np.full(temperature_k.shape, 5.0 * deviation),
        velocity_std_m_s=np.full((*temperature_k.shape, 3), deviation),
    )


def values(
    solution: Solution, scene: Scene = PLUG_ROOM, asked: IndoorAsked = IndoorAsked()
) -> dict[str, Quantity]:
    return {quantity.key: quantity for quantity in indoor(solution, scene, asked).quantities}


@pytest.fixture(scope="module")
def plain():
    return values(layered(), asked=IndoorAsked(source_m=(1.05, 1.0, 1.0)))


@pytest.fixture(scope="module")
def deviating():
    return values(layered(deviation=0.01))


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("head_to_ankle", 2.0), ("head_to_ankle_p95", 2.0), ("floor_to_ceiling", 3.6), ("speed_mean", 0.1),
        ("speed_p95", 0.1),
        # 0.1 m/s through 6 m2; a room of 24 m3.
        ("flow", 2160.0), ("air_changes", 90.0), ("nominal_time", 24 / 0.6 / 60),
        ("heat", 0.0),
    ],
)  # fmt: skip
def test_figures_by_hand(plain, key, expected):
    assert plain[key].value == pytest.approx(expected, rel=1e-6, abs=1e-9)


# With 17 vertices the lowest air is 0.125 m above the floor.
@pytest.mark.parametrize("vertices", [41, 17])
def test_a_warm_floor_is_not_the_air_over_it(vertices: int):
    velocity_m_s = np.zeros((7, 7, vertices, 3))
    velocity_m_s[..., 0] = 0.1
    found = box(velocity_m_s)
    kelvin = 295.0 + 2.0 * np.broadcast_to(found.z_m, found.temperature_k.shape)
    kelvin = np.where(found.z_m == 0.0, kelvin + 10.0, kelvin)
    assert values(replace(found, temperature_k=kelvin))["floor_to_ceiling"].value == pytest.approx(3.6)


@pytest.mark.parametrize(
    ("key", "expected"),
    # A plug on 20 cells: 20 / 21, half a cell of age too much.
    [
        ("efficiency", 100 * 20 / 21),
        ("mean_age", 24 / 0.6 / 60 / 2 * 21 / 20),
        ("source_effectiveness", 20 / 15),
    ],
)
def test_figures_of_a_plug_that_eddies_spread_a_little(plain, key, expected):
    # 0.002 m2/s beside 0.1 m/s times 4 m: half a percent of the plug, and more for the source next to it.
    assert plain[key].value == pytest.approx(expected, rel=0.03)


def test_every_figure_has_its_name_and_unit(plain):
    assert set(plain) == set(NAMES)
    assert all(told(quantity)[0] for quantity in plain.values())


def test_without_deviations_there_are_no_intervals(plain):
    assert {quantity.low for quantity in plain.values()} == {None}
    assert any("no deviations" in sentence for sentence in indoor(layered(), PLUG_ROOM).missing)


def test_an_interval_holds_the_found_value(deviating):
    for quantity in deviating.values():
        assert quantity.low is not None, quantity.key
        assert quantity.low <= quantity.value <= quantity.high, quantity.key


def test_the_flows_interval_follows_from_the_velocitys_deviation(deviating):
    flow = deviating["flow"]
    # A deviation of 10 % that goes together over a fifth of the room's edge, 0.58 m, and a wall of 3 x 2 m: its
    # mean varies by 10 % times the root of (sqrt(2 pi) 0.58)^2 / 6, up to the edges, so +-9 % at 95 %.
    half = 0.5 * (flow.high - flow.low) / flow.value
    assert 0.04 < half < 0.16


def test_no_share_is_beyond_its_ends():
    shaken = values(layered(deviation=0.2))
    for key in ("adpi", "draught_rate_p95", "ppd", "efficiency"):
        assert 0.0 <= shaken[key].low <= shaken[key].high <= 100.0


def test_the_same_result_gives_the_same_table(deviating):
    assert values(layered(deviation=0.01)) == deviating


def test_clothes_and_humidity_move_the_vote():
    cold = IndoorAsked(occupant=Occupant(clothing_clo=0.3))
    assert values(layered(), asked=cold)["pmv"].value < values(layered())["pmv"].value - 0.5


def test_a_result_of_temperature_alone_gives_what_it_can():
    found = indoor(replace(layered(), velocity_m_s=None), PLUG_ROOM)
    assert {quantity.key for quantity in found.quantities} == {
        "temperature_mean", "temperature_p95", "head_to_ankle", "head_to_ankle_p95", "floor_to_ceiling",
    }  # fmt: skip
    assert any("no velocity" in sentence and "standard" in sentence for sentence in found.missing)


def test_an_error_that_all_places_share_moves_the_mean_and_no_difference():
    still = replace(layered(), velocity_m_s=None)
    std_k = np.full(still.temperature_k.shape, 0.5)
    found = indoor(replace(still, temperature_std_k=std_k, temperature_shared_k=std_k[..., None]), PLUG_ROOM)
    by_key = {quantity.key: quantity for quantity in found.quantities}
    mean, rise = by_key["temperature_mean"], by_key["floor_to_ceiling"]
    # 32 samples tell a deviation to 13 %; three of those.
    assert mean.high - mean.low == pytest.approx(2 * 1.96 * 0.5, rel=0.4)
    assert rise.high - rise.low == pytest.approx(0.0, abs=1e-6)
    assert any("share" in note for note in found.notes)


def test_outlets_that_share_what_leaves_by_area_are_told():
    found = plug(12)
    supply, exhaust = OPENINGS
    second = replace(exhaust, patch=replace(OUTLET, lower_m=(1.0, 1.0), upper_m=(2.0, 1.5)))

    def notes(*outlets: Outlet) -> str:
        return " ".join(indoor(found, replace(PLUG_ROOM, boundary=(supply, *outlets))).notes)

    assert "outlets share it by area" not in notes(exhaust)
    assert "outlets share it by area" in notes(exhaust, second)
    assert "outlets share it by area" not in notes(replace(exhaust, flow_m3_s=0.1), second)


def test_how_outlets_share_what_leaves_is_in_the_intervals_of_the_exhaust_and_the_heat():
    found, (supply, exhaust) = layered(deviation=1e-4), OPENINGS
    above = Outlet(patch=replace(OUTLET, lower_m=(1.0, 1.5), upper_m=(2.0, 2.0)))

    def width(key: str, *outlets: Outlet) -> float:
        one = values(found, replace(PLUG_ROOM, boundary=(supply, *outlets)))[key]
        return one.high - one.low

    stated = (replace(exhaust, flow_m3_s=0.05), above)
    # Two equal outlets, a metre apart with the faces beside them, so 2 K; each sharing is as likely: 95 % of it.
    assert width("exhaust_temperature", exhaust, above) == pytest.approx(0.95 * 2.0, rel=0.15)
    assert width("exhaust_temperature", *stated) < 0.01
    assert width("heat", exhaust, above) > 100.0 * width("heat", *stated)
    assert width("flow", exhaust, above) == pytest.approx(width("flow", *stated))


def test_still_air_says_why_it_has_no_age():
    still = replace(layered(), velocity_m_s=np.zeros((21, 7, 7, 3)))
    found = indoor(still, replace(PLUG_ROOM, boundary=OPENINGS))
    assert any("no age of the air" in sentence for sentence in found.missing)
    assert "pmv" in {quantity.key for quantity in found.quantities}


def test_a_source_beside_the_room_is_refused():
    with pytest.raises(SettingError, match="z of the source"):
        indoor(layered(), PLUG_ROOM, IndoorAsked(source_m=(1.0, 1.0, 5.0)))


def test_a_zone_that_is_all_wall_is_refused():
    with pytest.raises(SettingError, match="smaller distance"):
        indoor(layered(), PLUG_ROOM, IndoorAsked(zone=OccupiedZone(from_walls_m=1.5)))


def test_the_packaged_rooms_age_at_the_outlet_is_volume_over_flow():
    found = packaged()
    room = Box(lower_m=(-1.2, -1.5, 0.0), upper_m=(2.9, 1.5, 3.0))
    change = age_of_air(found, replace(PLUG_ROOM, room=room))
    # V / Q of what was found, and of the stated 0.06 m3/s.
    assert change.leaving_age_s == pytest.approx(change.nominal_s, rel=1e-6)
    assert change.leaving_age_s == pytest.approx(36.9 / 0.06, rel=0.02)


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    settings = ExperimentSettings(rig=RigSettings(camera=SimulatedCameraSettings()), scene=PLUG_ROOM)
    made = create_experiment(tmp_path_factory.mktemp("indoor") / "experiment", settings)
    folder = made.results_folder / "one"
    folder.mkdir(parents=True)
    write_result(folder / "result.nc", layered(deviation=0.01), {})
    write_manifest(folder, {"preset": "standard", "captures": {}, "assumed": [], "inputs": {}})
    return made


def test_the_command_prints_the_table_and_its_assumptions(experiment):
    ran = CliRunner().invoke(create_cli(), ["indoor", str(experiment.folder), "--humidity", "40"])
    assert ran.exit_code == 0, ran.output
    assert "air change efficiency" in ran.output
    assert "40 % relative humidity" in " ".join(ran.output.split())


def test_the_command_prints_json(experiment):
    ran = CliRunner().invoke(create_cli(), ["indoor", str(experiment.folder), "--json"])
    found = {quantity["key"]: quantity for quantity in json.loads(ran.output)["quantities"]}
    assert found["flow"]["value"] == pytest.approx(2160.0, rel=1e-4)
    assert found["flow"]["low"] < 2160.0 < found["flow"]["high"]


def test_the_report_has_the_table_and_the_maps(experiment):
    page = render_report(read_finding(experiment, experiment.results_folder / "one"))
    section = page.split("<h2>People and ventilation</h2>")[1].split("<h2>")[0]
    assert section.count("data:image/png") == 1
    assert "air change efficiency" in section
    assert 'class="missing"' not in section


@pytest.mark.parametrize(
    ("value", "low", "high", "said"),
    [
        (0.018225, 0.00731, 0.0776, ("0.02 m/s", "0.01 to 0.08 m/s")),
        (0.018225, 0.0109, 0.0417, ("0.018 m/s", "0.011 to 0.042 m/s")),
        (23.85, 23.804, 23.864, ("23.9 m/s", "23.8 to 23.9 m/s")),
        (5.7378, 3.4722, 8.3933, ("5.7 m/s", "3.5 to 8.4 m/s")),
        (350.2, 219.4, 511.3, ("350 m/s", "219 to 511 m/s")),
        (68.35, 34.56, 74.53, ("68 m/s", "35 to 75 m/s")),
        (-0.0001, -0.5, 0.5, ("0.0 m/s", "-0.5 to 0.5 m/s")),
        (0.0, 0.0, 0.0, ("0 m/s", "0 m/s")),
        (12.345, None, None, ("12.3 m/s", "-")),
    ],
)
def test_a_figure_has_the_digits_that_its_interval_is_worth(value, low, high, said):
    assert told(Quantity("speed", "speed", "m/s", value, low, high))[1:] == said
