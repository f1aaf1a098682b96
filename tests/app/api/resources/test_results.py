"""Results as the page and other programs read them."""

import dataclasses
import json
import shutil
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

from app.api.wire.volumes import pack
from app.client import Client, ServiceError
from app.experiment.folder import read_manifest, save_settings, write_manifest
from app.experiment.found import Found
from app.experiment.results import write_result
from app.files.toml import to_plain
from app.volume.score import score_experiment
from core.estimate.diagnostics import doubtful
from core.objects import RoomObject
from core.result import Outcome, Solution
from core.scene import PointSensors
from tests.app.api.conftest import Live

AXES = [np.linspace(0.0, size, n) for size, n in ((4.0, 5), (3.0, 6), (2.0, 7))]
T = (293.0 + np.random.default_rng(0).normal(0, 2, (5, 6, 7))).astype(np.float32)
U = np.random.default_rng(1).normal(0, 0.2, (5, 6, 7, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def made(live: Live, airlens: Client) -> tuple[str, str]:
    experiment = airlens.create_experiment(camera_px=64).experiment
    folder: Path = live.app.state.services.folders.folder(experiment) / "results" / "r1"
    folder.mkdir(parents=True)
    solution = Solution(*AXES, temperature_k=T, velocity_m_s=U, outcome=Outcome.plateau, solver_s=2.5)
    write_result(folder / "result.nc", dataclasses.replace(solution, notes=("straight rays",)), {})
    (folder / "history.jsonl").write_text('{"loss": 1.0}\n{"loss": NaN}\n')
    (folder / "report.html").write_text("<h1>Report</h1><script>alert(1)</script>")
    write_manifest(folder, {"preset": "draft", "created": "2026-01-01T00:00:00+00:00", "outcome": "plateau"})
    (folder.parent / "r2").mkdir()
    return experiment, "r1"


def test_results_are_listed_and_interrupted_ones_are_told_apart(airlens: Client, made: tuple[str, str]):
    lines = airlens.results(made[0])
    assert [(line.result, line.state, line.preset) for line in lines] == [
        ("r1", "finished", "draft"),
        ("r2", "interrupted", None),
    ]
    with pytest.raises(ServiceError) as caught:
        airlens.result(made[0], "r2")
    assert caught.value.problem.code == "conflict"


def test_a_result_tells_its_grid_fields_and_end(airlens: Client, made: tuple[str, str]):
    result = airlens.result(*made)
    assert [field.name for field in result.fields if field.kind == "found"] == ["T", "u", "v", "w"]
    assert result.fields[0].maximum == float(T.max())
    assert (result.outcome, result.advice, result.notes) == (
        "plateau",
        Outcome.plateau.value,
        ["straight rays"],
    )
    assert result.y_m == AXES[1].tolist()


def test_what_must_be_looked_into_before_a_result_is_believed_is_told_apart(
    airlens: Client, live: Live, made: tuple[str, str]
):
    folder = live.app.state.services.folders.folder(made[0]) / "results" / made[1]
    before = read_manifest(folder)
    assert airlens.result(*made).doubts == []
    (wrong,) = doubtful(0.57)
    write_manifest(folder, before | {"assumed": ["Straight rays.", wrong]})
    told = airlens.result(*made).doubts
    write_manifest(folder, before)
    assert told == [wrong]
    assert "distrust the velocity" in wrong


BOX = RoomObject(name="found 1", lower_m=(0.5, -0.5, 0.0), upper_m=(0.9, -0.1, 1.2))
THING = Found(
    0, 0.03, (0.4, 1.0), (0.0, 1.2), (10.0, 20.0, 30.0, 40.0), "seen", BOX, True, "Something stands."
)


def test_what_was_found_is_offered_as_an_answer(airlens: Client, live: Live, made: tuple[str, str]):
    folder = live.app.state.services.folders.folder(made[0])
    result = folder / "results" / made[1]
    before = read_manifest(result)
    assert airlens.result(*made).found == []
    write_manifest(result, before | {"found": to_plain((THING,))})
    (one,) = airlens.result(*made).found
    assert (one.name, one.sentence, one.solved) == ("found 1", "Something stands.", True)
    assert one.answer["kind"] == "box"
    assert "lower_m = [0.5, -0.5, 0.0]" in one.entry

    answers = next(each.answers for each in airlens.templates() if each.template == "sample")
    entered = airlens.create_from_answers(answers).experiment
    there = live.app.state.services.folders.folder(entered) / "results" / "r1"
    shutil.copytree(result, there)
    (offered,) = airlens.result(entered, "r1").found
    changed = answers | {"object": [offered.answer]}
    assert airlens.check_answers(changed, entered).mistakes == []
    airlens.change_answers(entered, changed)
    (stated,) = live.app.state.services.folders.open(entered).settings.scene.objects
    assert stated.lower_m == pytest.approx(BOX.lower_m)

    write_manifest(result, before | {"found": [{"view": "one"}]})
    with pytest.raises(ServiceError, match="cannot be read"):
        airlens.result(*made)
    write_manifest(result, before)


def test_volumes_and_slices_are_the_numbers_of_the_result(airlens: Client, made: tuple[str, str]):
    assert np.array_equal(airlens.volume(*made, "T"), T)
    assert np.array_equal(airlens.volume(*made, "w"), U[..., 2])
    assert np.array_equal(airlens.slice(*made, "T", "y", 2), T[:, 2])


@pytest.mark.parametrize(("encoding", "error_k"), [("u16", 0.5 / 65535), ("f16", 1 / 2048), ("f32", 0.0)])
def test_encodings_are_as_fine_as_they_say(encoding, error_k: float):
    packed = pack(T, encoding)
    kind = {"u16": "<u2", "f16": "<f2", "f32": "<f4"}[encoding]
    values = packed.offset + packed.scale * np.frombuffer(packed.content, kind).astype(np.float64)
    # Half a step of the range (u16), of the largest number about the middle (f16); float32 in between.
    span_k = float(np.ptp(T))
    assert np.abs(values.reshape(T.shape) - T).max() <= error_k * span_k + 2e-5 * (encoding != "f32")


def test_where_there_is_no_air_no_number_is_sent():
    holed = T.copy()
    holed[1, 1, 1] = np.nan
    packed = pack(holed, "u16")
    numbers = np.frombuffer(packed.content, "<u2").reshape(T.shape)
    assert packed.headers["X-Missing"] == "65535"
    assert np.array_equal(numbers == 65535, np.isnan(holed))
    values = packed.offset + packed.scale * numbers.astype(np.float64)
    assert np.nanmax(np.abs(values - holed)[numbers < 65535]) < 1e-4
    assert "X-Missing" not in pack(T, "u16").headers


def test_a_report_runs_nothing_and_reaches_nothing(live: Live, airlens: Client, made: tuple[str, str]):
    assert airlens.report(*made).startswith("<h1>Report")
    with live.client() as http:
        policy = http.get(f"/api/experiments/{made[0]}/results/{made[1]}/report").headers
    assert "sandbox" in policy["content-security-policy"]
    assert "script-src" not in policy["content-security-policy"]
    assert "default-src 'none'" in policy["content-security-policy"]


def test_history_has_null_for_what_is_not_finite(airlens: Client, made: tuple[str, str]):
    assert airlens.history(*made) == [{"loss": 1.0}, {"loss": None}]


def test_exports_are_files_for_other_programs(airlens: Client, made: tuple[str, str], tmp_path: Path):
    for form in ("nc", "h5", "vti", "csv", "zip", "png"):
        file = airlens.export(*made, form, tmp_path / f"result.{form}")
        assert file.stat().st_size > 100
    with h5py.File(tmp_path / "result.h5") as file:
        assert np.array_equal(file["T"][...], T)
    with zipfile.ZipFile(tmp_path / "result.zip") as case:
        lines = case.read("case/0/T").decode().splitlines()
        assert "(4 5 6)" in case.read("case/system/blockMeshDict").decode()
    first = lines.index("(") + 1
    # x fastest: the second cell is the next one along x.
    assert float(lines[first + 1]) == pytest.approx(float(T[1:3, :2, :2].mean(dtype=np.float64)), rel=1e-6)
    assert lines[first + 4 * 5 * 6] == ");"
    assert (tmp_path / "result.csv").read_text().count("\n") == 1 + T.size


def test_a_simulated_room_shows_its_truth_and_the_error(airlens: Client, live: Live, made: tuple[str, str]):
    fields = {field.name: field for field in airlens.result(*made).fields}
    assert (fields["T_truth"].kind, fields["u_error"].kind) == ("truth", "error")
    error = airlens.volume(*made, "T") - airlens.volume(*made, "T_truth")
    assert airlens.volume(*made, "T_error") == pytest.approx(error, abs=1e-4)
    folder = live.app.state.services.folders.folder(made[0])
    scores = {one.name: one.value for one in airlens.comparison(*made).scores}
    # The report's figures.
    reported = score_experiment(folder, folder / "truth.npz", folder / "results" / "r1")["T"]
    assert scores["T: rms error"] == reported["rms_K"]
    (relative,) = (value for name, value in scores.items() if "each height's mean" in name)
    assert relative == reported["rel_departure"]


def test_point_sensors_stand_beside_what_was_found_there(airlens: Client, live: Live, made: tuple[str, str]):
    experiment = live.app.state.services.folders.open(made[0])
    (experiment.folder / "sensors.csv").write_text("x,y,z,T,T_std,u\n1,0.6,1,294.5,0.1,\n2,1.2,1,,,0.3\n")
    scene = experiment.settings.scene
    known = (*scene.boundary, PointSensors(file="sensors.csv"))
    changed = experiment.settings.model_copy(update={"scene": dataclasses.replace(scene, boundary=known)})
    save_settings(experiment.folder, changed)
    first, second = airlens.comparison(*made).readings
    save_settings(experiment.folder, experiment.settings)
    assert (first.name, first.measured, first.std) == ("T", 294.5, 0.1)
    assert first.found == pytest.approx(float(T[1, 1, 3]), abs=1e-4)
    assert (second.name, second.position_m) == ("u", [2.0, 1.2, 1.0])
    assert second.found == pytest.approx(float(U[2, 2, 3, 0]), abs=1e-6)


def test_presets_are_listed_with_what_they_are(airlens: Client):
    presets = airlens.presets()
    assert [one.preset for one in presets[:2]] == ["auto", "draft"]
    assert all(json.dumps(one.about) != '""' for one in presets)


@pytest.mark.parametrize("path", ["volumes/q", "slices/T?axis=y&index=6", "slices/T?axis=q", "nothing"])
def test_what_is_not_there_is_said(live: Live, made: tuple[str, str], path: str):
    with live.client() as http:
        answer = http.get(f"/api/experiments/{made[0]}/results/{made[1]}/{path}")
    assert answer.status_code in (404, 422)
    assert answer.json()["next_step"]
