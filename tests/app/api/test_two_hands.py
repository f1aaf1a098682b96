"""Two at once: no answer of 5xx, no file that cannot be read, no acknowledged change lost; both versions told."""

import threading

from tests.app.api.conftest import Live, is_problem
from tests.benchmarks.two_hands import rounds


def test_parallel_writers_lose_nothing(live: Live):
    counts = rounds(live.url, live.token, live.config.data_root, number=12, hands=4)
    assert counts["acknowledged"] > 20
    assert not any(name.startswith("5") for name in counts)
    assert (counts["lost"], counts["corrupt"], counts["left over"]) == (0, 0, 0)


def test_who_changes_what_somebody_else_changed_is_told_both_versions(live: Live):
    with live.client() as client:
        made = client.post("/api/experiments", json={"kind": "simulated", "camera_px": 64})
        path = f"/api/experiments/{made.json()['experiment']}"
        seen = made.headers["etag"]
        first = client.patch(path, json={"title": "Hers"}, headers={"If-Match": seen})
        assert first.status_code == 200
        second = client.patch(path, json={"title": "His"}, headers={"If-Match": seen})
        assert second.status_code == 412
        assert is_problem(second, "changed")
        assert second.json()["current"]["title"] == "Hers"
        assert second.json()["current"]["revision"] == first.json()["revision"]
        assert second.json()["sent"] == {"title": "His"}
        again = client.patch(path, json={"title": "His"}, headers={"If-Match": first.headers["etag"]})
        assert again.json()["title"] == "His"
        # Without a revision only the fields that are sent are changed.
        assert client.patch(path, json={"information": "dry"}).json()["title"] == "His"


def test_marks_are_drawn_in_the_picture_and_stay_when_something_else_changes(live: Live):
    with live.client() as client:
        made = client.post("/api/experiments", json={"kind": "simulated", "camera_px": 64})
        path = f"/api/experiments/{made.json()['experiment']}"
        drawn = {"name": "board", "lower_px": [0, 0.5], "upper_px": [20, 15]}
        done = client.patch(path, json={"marks": [drawn]})
        assert done.status_code == 200
        assert done.headers["etag"] != made.headers["etag"]
        kept = client.patch(path, json={"title": "Marked"}).json()["settings"]["scene"]["views"][0]["marks"]
        assert kept == [{"name": "board", "lower_px": [0.0, 0.5], "upper_px": [20.0, 15.0]}]
        outside = client.patch(path, json={"marks": [drawn | {"upper_px": [200, 15]}]})
        assert is_problem(outside, "bad_input")
        assert "Draw them within it" in outside.json()["detail"]
        assert client.patch(path, json={"marks": []}).json()["settings"]["scene"]["views"][0]["marks"] == []


def test_experiments_that_are_made_at_once_all_appear_whole(live: Live):
    answers = []

    def make():
        with live.client() as client:
            answers.append(client.post("/api/experiments", json={"kind": "simulated", "camera_px": 64}))

    threads = [threading.Thread(target=make) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [answer.status_code for answer in answers] == [201] * 4
    assert len({answer.json()["experiment"] for answer in answers}) == 4
    assert not list((live.config.data_root / "experiments").glob(".*"))
