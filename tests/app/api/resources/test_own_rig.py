"""Doors of a lab's own rig: found cameras, ports, uploaded rooms, pictures of other cameras, prints."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
import tifffile

from app.client import Client, ServiceError
from app.experiment.captures import load_capture
from app.experiment.folder import open_experiment, save_settings
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.file import read_volume
from tests.app.api.conftest import Live
from tests.drivers.aravis.fake import ADDRESS, fake_camera, missing, opened


@pytest.fixture
def client(live: Live) -> Iterator[Client]:
    with Client(live.url, live.token) as open_client:
        yield open_client


def answers_of(client: Client, name: str) -> dict:
    return next(one.answers for one in client.templates() if one.template == name)


def room_file(folder: Path) -> Path:
    """The packaged room without what is no number, as a lab exports it."""
    with np.load(SAMPLE_ROOM, allow_pickle=False) as arrays:
        kept = {name: arrays[name] for name in arrays.files if arrays[name].dtype.kind in "fiu"}
    np.savez_compressed(folder / "room.npz", **kept)
    return folder / "room.npz"


def test_an_uploaded_room_stands_among_the_cameras_and_is_what_its_camera_looks_at(
    client: Client, live: Live, tmp_path: Path
):
    upload = client.upload(room_file(tmp_path)).upload
    (found,) = [one for one in client.found_cameras() if one.device == upload]
    assert found.kind == "simulated"
    sent = answers_of(client, "sample")
    sent["camera"] = {**sent["camera"], "truth": upload}
    checked = client.check_answers(sent)
    assert checked.mistakes == []
    made = client.create_from_answers(sent)
    truth = live.app.state.services.folders.folder(made.experiment) / "truth.npz"
    np.testing.assert_array_equal(read_volume(truth).velocity_m_s, read_volume(SAMPLE_ROOM).velocity_m_s)
    client.delete_upload(upload)
    assert upload not in [one.device for one in client.found_cameras()]
    with pytest.raises(ServiceError, match="no room of this service"):
        client.create_from_answers(sent)


def test_an_upload_that_is_no_room_is_no_camera(client: Client, tmp_path: Path):
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    upload = client.upload(tmp_path / "other.npz").upload
    assert upload not in [one.device for one in client.found_cameras()]


@missing
def test_a_found_camera_shows_a_picture(client: Client):
    with fake_camera():
        opened().close()
        (found,) = [one for one in client.found_cameras() if one.kind == "aravis" and ADDRESS in one.name]
        assert [one.pixel_format for one in found.formats] == ["Mono16", "Mono8"]
        picture = cv2.imdecode(np.frombuffer(client.found_picture(found), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture.shape == (found.height_px, found.width_px)
    with pytest.raises(ServiceError, match="There is no camera"):
        client.found_picture(found.model_copy(update={"device": "/dev/mem"}))


def test_only_a_port_that_was_listed_is_asked(client: Client, tmp_path: Path):
    assert all(one.device for one in client.ports())
    with pytest.raises(ServiceError, match="no serial port"):
        client.ask_port(str(tmp_path / "port"))


def pictures(shape: tuple[int, int], shift: int) -> list[np.ndarray]:
    draw = np.random.default_rng(3)
    still = draw.integers(500, 3500, shape)
    return [
        np.roll(still, shift, 1).astype(np.uint16) + draw.integers(0, 30, shape).astype(np.uint16)
        for _ in range(4)
    ]


def test_dropped_pictures_become_captures_as_import_makes_them(client: Client, live: Live, tmp_path: Path):
    made = client.create_experiment(camera_px=64).experiment
    tifffile.imwrite(tmp_path / "reference.tif", np.stack(pictures((48, 64), 0)), photometric="minisblack")
    sent: dict = {"reference": [client.upload(tmp_path / "reference.tif").upload], "flow": []}
    for number, picture in enumerate(pictures((48, 64), 1)):
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture)
        sent["flow"].append(client.upload(tmp_path / f"{number}.png").upload)
    taken = client.import_captures(made, sent, bits=12)
    assert [(one.role, one.frames, one.state) for one in taken] == [
        ("reference", 4, "finished"),
        ("flow", 4, "finished"),
    ]
    mean = client.capture_image(made, taken[0].capture)
    np.testing.assert_allclose(mean, np.mean(pictures((48, 64), 0), axis=0) / 4095, atol=1e-6)
    assert client.uploads() == [] or not {one.upload for one in client.uploads()} & {*sent["flow"]}


@pytest.fixture
def two_cameras(client: Client, live: Live) -> str:
    """An experiment with two views, `camera` and `second`, of 64 x 48 px each."""
    made = client.create_experiment(camera_px=64).experiment
    found = open_experiment(live.app.state.services.folders.folder(made))
    (first,) = found.settings.scene.views
    scene = replace(found.settings.scene, views=(first, replace(first, name="second")))
    save_settings(found.folder, found.settings.model_copy(update={"scene": scene}))
    return made


def uploaded(client: Client, folder: Path, shift: int, shape: tuple[int, int] = (48, 64)) -> str:
    """The upload of a TIFF of four pictures, named after the shift."""
    path = folder / f"{shift}.tif"
    tifffile.imwrite(path, np.stack(pictures(shape, shift)), photometric="minisblack")
    return client.upload(path).upload


def test_pictures_of_two_cameras_are_one_capture_once_both_are_there(
    client: Client, two_cameras: str, tmp_path: Path
):
    made = two_cameras
    assert [one.name for one in client.experiment(made).views] == ["camera", "second"]
    uploads = [uploaded(client, tmp_path, shift) for shift in (0, 1)]
    with pytest.raises(ServiceError, match="2 views: 'camera', 'second'"):
        client.import_captures(made, {"reference": uploads[:1]})
    (waiting,) = client.import_captures(made, {"reference": uploads[:1]}, view="second")
    assert (waiting.state, waiting.role, waiting.missing) == ("interrupted", "reference", ["camera"])
    assert [one.view for one in waiting.views] == ["second"]
    (whole,) = client.import_captures(made, {"reference": uploads[1:]}, view="camera")
    assert (whole.capture, whole.state, whole.missing) == (waiting.capture, "finished", [])
    assert [(one.view, one.frames) for one in whole.views] == [("camera", 4), ("second", 4)]
    mean = client.capture_image(made, whole.capture, view=1)
    np.testing.assert_allclose(mean, np.mean(pictures((48, 64), 0), axis=0) / (2**16 - 1), atol=1e-6)
    with pytest.raises(ServiceError, match="has 2 views"):
        client.capture_image(made, whole.capture, view=2)


def imported(live: Live, experiment: str, *pictures: tuple[str, str, list[str]]) -> httpx.Response:
    """The answer to an import of several cameras at once: role, view and uploads of each."""
    sent = [{"role": role, "view": view, "uploads": uploads} for role, view, uploads in pictures]
    with live.client() as asking:
        return asking.post(f"/api/experiments/{experiment}/captures/imported", json={"pictures": sent})


def test_all_cameras_pictures_come_in_one_request_and_what_is_refused_stays(
    client: Client, live: Live, two_cameras: str, tmp_path: Path
):
    first, second, again, other = (uploaded(client, tmp_path, shift) for shift in (0, 1, 1, 2))
    wide = uploaded(client, tmp_path, 3, (48, 100))
    for views, words in (
        ((("flow", "camera", [first]), ("flow", "second", [wide])), "100 x 48 px; the camera 'second'"),
        (
            (("flow", "camera", [second]), ("flow", "second", [again])),
            "1.tif, page 1 is named as flow of 'camera' and as flow of 'second'",
        ),
        ((("flow", "camera", [first]), ("flow", "third", [second])), "no view 'third'"),
    ):
        refused = imported(live, two_cameras, *views)
        assert words in refused.json()["detail"], refused.text
    assert client.captures(two_cameras) == []
    assert {first, second, again, wide} <= {one.upload for one in client.uploads()}
    # Two lists of one camera are one list.
    whole = imported(
        live,
        two_cameras,
        ("flow", "camera", [first]),
        ("flow", "second", [second]),
        ("flow", "camera", [other]),
    )
    (taken,) = whole.json()
    assert (taken["state"], taken["missing"]) == ("finished", [])
    assert [(one["view"], one["frames"]) for one in taken["views"]] == [("camera", 8), ("second", 4)]


def test_the_client_sends_the_pictures_of_all_cameras_at_once(
    client: Client, two_cameras: str, tmp_path: Path
):
    still, moved, of_second, moved_too = (uploaded(client, tmp_path, shift) for shift in range(4))
    # Only what is sent together is held against one another before anything is kept.
    with pytest.raises(ServiceError, match=r"0\.tif, page 1 is named as reference of 'camera' and as"):
        client.import_views(two_cameras, {"camera": {"reference": [still]}, "second": {"reference": [still]}})
    assert client.captures(two_cameras) == []
    given: dict = {
        "camera": {"reference": [still], "flow": [moved]},
        "second": {"reference": [of_second], "flow": [moved_too]},
    }
    taken = client.import_views(two_cameras, given, ambient_temperature_k=291.0)
    assert [(one.role, one.state, one.missing) for one in taken] == [
        ("reference", "finished", []),
        ("flow", "finished", []),
    ]
    for role, shifts in ((0, (0, 2)), (1, (1, 3))):
        for view, shift in enumerate(shifts):
            mean = client.capture_image(two_cameras, taken[role].capture, view=view)
            expected = np.mean(pictures((48, 64), shift), axis=0) / (2**16 - 1)
            np.testing.assert_allclose(mean, expected, atol=1e-6)


def test_cameras_that_were_confused_are_put_right_together(
    client: Client, live: Live, two_cameras: str, tmp_path: Path
):
    wrong, of_camera, of_second = (uploaded(client, tmp_path, shift) for shift in (1, 0, 1))
    assert imported(live, two_cameras, ("reference", "camera", [wrong])).json()[0]["missing"] == ["second"]
    alone = imported(live, two_cameras, ("reference", "second", [of_second]))
    assert re.match(
        r"1\.tif, page \d was imported as the reference of 'camera' already", alone.json()["detail"]
    )
    right = (("reference", "camera", [of_camera]), ("reference", "second", [of_second]))
    (taken,) = imported(live, two_cameras, *right).json()
    assert taken["state"] == "finished"
    for view in (0, 1):
        mean = client.capture_image(two_cameras, taken["capture"], view=view)
        np.testing.assert_allclose(mean, np.mean(pictures((48, 64), view), axis=0) / (2**16 - 1), atol=1e-6)


def test_what_is_wrong_with_a_picture_names_it_as_its_owner_does(client: Client, live: Live, tmp_path: Path):
    made = client.create_experiment(camera_px=64).experiment
    for name, picture in (
        ("good 1.png", np.zeros((48, 64), np.uint16)),
        ("larger.png", np.zeros((50, 64), np.uint16)),
        ("brighter & so on.png", np.full((48, 64), 5000, np.uint16)),
    ):
        cv2.imwrite(str(tmp_path / name), picture)
    tifffile.imwrite(tmp_path / "floats.tif", np.zeros((2, 48, 64)), photometric="minisblack")
    (tmp_path / "cut.png").write_bytes((tmp_path / "brighter & so on.png").read_bytes()[:90])
    good, *wrong = (
        client.upload(tmp_path / name)
        for name in ("good 1.png", "larger.png", "brighter & so on.png", "floats.tif")
    )
    assert good.name == "good 1.png"
    for one, words in zip(
        wrong,
        (
            "larger.png has 64 x 50 px, the first picture 64 x 48",
            "brighter & so on.png holds 5000 counts; 12 bits",
            "floats.tif, page 1 holds float64 of shape",
        ),
        strict=True,
    ):
        with pytest.raises(ServiceError, match=f"^{words}"):
            client.import_captures(made, {"flow": [good.upload, one.upload]}, bits=12)
    with pytest.raises(ServiceError, match=r"^cut\.png: The file cannot be read"):
        client.upload(tmp_path / "cut.png")
    (taken,) = client.import_captures(made, {"flow": [good.upload]})
    kept = load_capture(live.app.state.services.folders.folder(made) / "captures" / taken.capture)
    assert [one["name"] for one in kept.manifest["origin"]["files"]] == ["good 1.png"]


def test_a_picture_that_was_sent_without_a_name_is_named_as_the_service_does(
    client: Client, live: Live, tmp_path: Path
):
    made = client.create_experiment(camera_px=64).experiment
    floats = tmp_path / "floats.tif"
    tifffile.imwrite(floats, np.zeros((48, 64)))
    with live.client() as asking:
        octets = {"Content-Type": "application/octet-stream"}
        upload = asking.post("/api/uploads", content=floats.read_bytes(), headers=octets).json()["upload"]
    with pytest.raises(ServiceError, match=f"^{upload} holds float64"):
        client.import_captures(made, {"flow": [upload]})


def test_pictures_of_a_wrong_size_are_refused_with_both_sizes_and_jpeg_is_said_to_cost(
    client: Client, tmp_path: Path
):
    made = client.create_experiment(camera_px=64).experiment
    cv2.imwrite(str(tmp_path / "wide.png"), np.zeros((48, 100), np.uint8))
    wrong = client.upload(tmp_path / "wide.png").upload
    with pytest.raises(ServiceError, match=r"The flow pictures have 100 x 48 px; the camera .* has 64 x 48"):
        client.import_captures(made, {"flow": [wrong]})
    assert client.captures(made) == []
    with pytest.raises(ServiceError, match="no upload 'u0'"):
        client.import_captures(made, {"flow": ["u0"]})
    names = []
    for number in range(2):
        grey = np.random.default_rng(number).integers(40, 200, (48, 64)).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.jpg"), grey)
        names.append(client.upload(tmp_path / f"{number}.jpg"))
    assert {one.kind for one in names} == {"jpeg"}
    (taken,) = client.import_captures(made, {"flow": [one.upload for one in names]})
    assert any(one.name == "compression" and not one.good for one in taken.verdicts)


def test_pattern_and_board_are_printed_and_read(client: Client, tmp_path: Path):
    sent = answers_of(client, "empty")
    sent["room"], sent["camera"] = ["1 m", "1 m", "0.6 m"], {**sent["camera"], "distance": "0.9 m"}
    made = client.create_from_answers(sent).experiment
    with pytest.raises(ServiceError, match="No pattern was printed"):
        client.read_print(made, "pattern", tmp_path / "none.pdf")
    printed = client.print_pattern(made, "a2")
    assert printed.paper == "a2"
    assert printed.is_of_the_scene
    assert client.read_print(made, "pattern", tmp_path / "pattern.pdf").read_bytes().startswith(b"%PDF")
    board = client.print_board(made, "a4")
    assert (board.what, board.paper, board.sheets) == ("board", "a4", [1, 1])
    assert client.read_print(made, "board", tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    assert client.experiment(made).settings["rig"]["board"]["kind"] == "charuco"
    assert [one.what for one in client.prints(made)] == ["pattern", "board"]
    with pytest.raises(ServiceError, match="a4"):
        client.print_pattern(made, "a9")
