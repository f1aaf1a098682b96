"""An experiment made from answers by the service: templates, check, creation, change with its revision."""

from collections.abc import Iterator

import pytest

from app.client import Client, ServiceError
from app.setup.experiment import TEMPLATES
from tests.app.api.conftest import Live


@pytest.fixture
def client(live: Live) -> Iterator[Client]:
    with Client(live.url, live.token) as open_client:
        yield open_client


def answers_of(client: Client, name: str) -> dict:
    return next(one.answers for one in client.templates() if one.template == name)


def test_every_template_is_right_and_is_told_what_it_makes(client: Client):
    assert [one.template for one in client.templates()] == list(TEMPLATES)
    for one in client.templates():
        found = client.check_answers(one.answers)
        assert found.mistakes == []
        assert found.told is not None
    told = client.check_answers(answers_of(client, "wall-jet")).told
    # 120 m3/h through 0.6 x 0.2 m.
    assert told.supplies[0].speed_m_s == pytest.approx(120 / 3600 / 0.12)
    assert told.picture_m == pytest.approx([4.50, 2.81], abs=0.01)
    assert {one.role for one in told.standing} == {"camera"}


def test_the_simulated_camera_is_always_among_those_found(client: Client):
    assert [one.kind for one in client.found_cameras()][-1] == "simulated"


def test_an_experiment_is_made_from_answers_and_its_answers_are_changed(client: Client):
    sent = answers_of(client, "wall-jet")
    made = client.create_from_answers(sent)
    kept = client.answers(made.experiment)
    assert kept.answers == sent
    light = made.settings["scene"]["light"]
    changed = {**sent, "room": ["5 m", "3 m", "2.7 m"], "title": "Longer"}
    changed["outlet"] = [{**sent["outlet"][0], "temperature": "23 C"}]
    later = client.change_answers(made.experiment, changed, kept.revision)
    assert later.title == "Longer"
    assert later.settings["scene"]["room"]["upper_m"] == [5.0, 3.0, 2.7]
    # The print hangs there already.
    assert later.settings["scene"]["light"] == light
    with pytest.raises(ServiceError) as refused:
        client.change_answers(made.experiment, sent, kept.revision)
    assert refused.value.problem.status == 412
    assert client.answers(made.experiment).answers == changed


def test_a_check_tells_what_no_field_alone_has_wrong(client: Client):
    sent = answers_of(client, "wall-jet")
    sent["camera"] = {**sent["camera"], "distance": "1 um"}
    found = client.check_answers(sent)
    assert [one.field for one in found.mistakes] == [""]
    assert "printed pattern pixel" in found.mistakes[0].sentence
    assert found.told is None


def test_wrong_answers_make_nothing_and_change_nothing(client: Client):
    before = len(client.experiments())
    sent = answers_of(client, "wall-jet")
    with pytest.raises(ServiceError, match=r"supply\[0\]\.flow: .*has no unit"):
        client.create_from_answers({**sent, "supply": [{**sent["supply"][0], "flow": "120"}]})
    assert len(client.experiments()) == before


@pytest.mark.parametrize("truth", ["/etc/passwd", "room.npz", "../sample"])
def test_a_request_names_no_file_of_the_machine(client: Client, truth: str):
    sent = answers_of(client, "sample")
    sent["camera"] = {**sent["camera"], "truth": truth}
    assert [one.field for one in client.check_answers(sent).mistakes] == ["camera.truth"]
    with pytest.raises(ServiceError, match="no room of this service"):
        client.create_from_answers(sent)


def test_a_room_that_a_file_described_is_edited_as_answers(client: Client):
    made = client.create_experiment(camera_px=64)
    told = client.answers(made.experiment)
    assert told.unsaid == ["boundary/plane_x_min.npz: temperature and velocity known on the plane x_min."]
    assert client.check_answers(told.answers, made.experiment).mistakes == []
    supply = {**told.answers["supply"][0], "temperature": "29 C"}

    later = client.change_answers(made.experiment, {**told.answers, "supply": [supply]}, told.revision)

    kinds = [one["kind"] for one in later.settings["scene"]["boundary"]]
    assert "plane_field" in kinds
    assert client.answers(made.experiment).answers["supply"] == [supply]


def test_a_room_that_no_camera_of_the_page_sees_says_where_it_is_edited(client: Client, live: Live):
    made = client.create_experiment(camera_px=64)
    file = live.app.state.services.folders.folder(made.experiment) / "experiment.toml"
    text = file.read_text()
    assert 'wall = "y_max"' in text
    side = text.replace('wall = "y_max"', 'wall = "x_max"', 1)
    file.write_text(side.replace("position_m = [0", "position_m = [-50", 1))
    with pytest.raises(ServiceError, match=r"No camera looks at the wall y_max.*experiment\.toml"):
        client.answers(made.experiment)
