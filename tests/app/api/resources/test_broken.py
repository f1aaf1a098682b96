"""Folders from elsewhere: what is broken is a line with its reason, and opens no device unasked."""

import shutil

import pytest

from tests.app.api.conftest import Live, is_problem

DEEP = "a = " + "[" * 2000
DIGITS = "schema_version = " + "1" * 5000


def made(live: Live) -> str:
    with live.client() as client:
        answer = client.post("/api/experiments", json={"kind": "simulated", "camera_px": 64})
    return answer.json()["experiment"]


@pytest.mark.parametrize(
    "text", [b"", b"\xff", DEEP.encode(), DIGITS.encode(), b"scene = 1", b"title = '\x00'"]
)
def test_an_experiment_that_cannot_be_read_is_a_line_with_its_reason(live: Live, text: bytes):
    sound, broken = made(live), made(live)
    path = live.config.data_root / "experiments" / broken / "experiment.toml"
    path.write_bytes(text)
    with live.client() as client:
        lines = {line["experiment"]: line for line in client.get("/api/experiments").json()}
        assert lines[sound]["reason"] == ""
        assert "experiment.toml" in lines[broken]["reason"]
        assert is_problem(client.get(f"/api/experiments/{broken}"), "bad_input")
        assert is_problem(client.patch(f"/api/experiments/{broken}", json={"title": "x"}), "bad_input")
    assert path.read_bytes() == text
    shutil.rmtree(path.parent)


@pytest.mark.parametrize("text", [b"", b"[" * 50_000, b'{"date": ' + b"9" * 5000, b"\xff"])
def test_a_calibration_that_cannot_be_read_is_a_reason_and_no_fault(live: Live, text: bytes):
    experiment = made(live)
    folder = live.config.data_root / "experiments" / experiment / "calibration"
    folder.mkdir()
    (folder / "bundle.json").write_bytes(text)
    with live.client() as client:
        lines = {line["experiment"]: line for line in client.get("/api/experiments").json()}
        assert "bundle.json" in lines[experiment]["reason"]
        assert is_problem(client.get(f"/api/experiments/{experiment}/calibration"), "bad_input")
    shutil.rmtree(folder.parent)


@pytest.mark.parametrize(
    "text", [b"", b"[]", b"{}", b"[" * 5000, b'{"views": 1, "role": "flow"}', b'{"role": "\\ud800"}', b"\xff"]
)
def test_broken_captures_results_and_uploads_are_lines_with_their_reason(live: Live, text: bytes):
    experiment = made(live)
    folder = live.config.data_root / "experiments" / experiment
    upload = live.config.data_root / "uploads" / "u1"
    for parent in (folder / "captures" / "c1", folder / "results" / "r1", upload):
        parent.mkdir(parents=True)
        (parent / "manifest.json").write_bytes(text)
    with live.client() as client:
        (capture,) = client.get(f"/api/experiments/{experiment}/captures").json()
        assert (capture["state"], "manifest.json" in capture["reason"]) == ("broken", True)
        (result,) = client.get(f"/api/experiments/{experiment}/results").json()
        assert result["state"] == ("finished" if text.startswith(b"{") and b"ud800" not in text else "broken")
        (line,) = client.get("/api/uploads").json()
        assert line["kind"] == "broken"
        assert line["reason"]
        for address in (
            f"captures/c1/picture?width={10**40}",
            "captures/c1/picture",
            "results/r1",
            "captures/c1",
        ):
            assert client.get(f"/api/experiments/{experiment}/{address}").status_code in (404, 422)
        assert client.delete(f"/api/experiments/{experiment}/captures/c1").status_code == 204
        assert client.delete("/api/uploads/u1").status_code == 204
    shutil.rmtree(folder)


def test_a_manifest_names_files_of_its_own_folder_only(live: Live, tmp_path):
    experiment = made(live)
    folder = live.config.data_root / "experiments" / experiment / "captures" / "c1"
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text(
        '{"role": "reference", "complete": true, "views": [{"file": "../../../../service/token"}]}'
    )
    with live.client() as client:
        answer = client.get(f"/api/experiments/{experiment}/captures/c1/picture")
    assert is_problem(answer, "bad_input")
    assert "points outside" in answer.json()["detail"]


ADDRESSES = [
    "pjlink://[",
    "simulated://[",
    "pjlink://a..b",
    "escvp21:/dev/null?baud=-1",
    "simulated:?warm_up_s=nan",
]


@pytest.mark.parametrize("url", ADDRESSES)
def test_an_address_that_is_none_is_refused(live: Live, url: str):
    experiment = made(live)
    path = live.config.data_root / "experiments" / experiment / "experiment.toml"
    path.write_text(path.read_text() + f'\n[rig.projector]\nurl = "{url}"\n')
    with live.client() as client:
        named = [
            line["address"]
            for line in client.get(f"/api/experiments/{experiment}/addresses").json()["addresses"]
        ]
        client.put(f"/api/experiments/{experiment}/addresses", json={"addresses": named}).raise_for_status()
        answer = client.post("/api/devices/projector/connect", json={"experiment": experiment})
    assert is_problem(answer, "bad_input")


def test_a_device_is_opened_only_once_its_address_was_confirmed(live: Live):
    experiment = made(live)
    path = live.config.data_root / "experiments" / experiment / "experiment.toml"
    path.write_text(path.read_text() + '\n[rig.projector]\nurl = "escvp21:/dev/nothing-here"\n')
    here = f"/api/experiments/{experiment}/addresses"
    with live.client() as client:
        asked = {"json": {"experiment": experiment}}
        refused = client.post("/api/devices/projector/connect", **asked)
        assert is_problem(refused, "unconfirmed")
        assert refused.json()["current"] == {"addresses": ["escvp21:/dev/nothing-here"]}
        capture = client.post(f"/api/experiments/{experiment}/captures", json={"role": "flow"})
        assert is_problem(capture, "unconfirmed")
        assert is_problem(client.put(here, json={"addresses": ["escvp21:/dev/other"]}), "conflict")
        told = client.put(here, json={"addresses": ["escvp21:/dev/nothing-here"]}).json()
        assert told == {"addresses": [{"address": "escvp21:/dev/nothing-here", "confirmed": True}]}
        # It is asked now, and is not there.
        assert client.post("/api/devices/projector/connect", **asked).json()["state"] == "lost"
        client.post("/api/devices/projector/disconnect")
        # Another address in its place is asked for again.
        path.write_text(path.read_text().replace("nothing-here", "mem"))
        assert is_problem(client.post("/api/devices/projector/connect", **asked), "unconfirmed")
