"""Several cameras on the page: one that failed is taken again alone, from beside its verdict."""

import pytest
from playwright.sync_api import expect

from app.errors import BadInputError
from app.rig.open import open_camera
from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_faults import go_to
from tests.browser.two_views import VIEWS, two_views


def test_a_camera_that_failed_is_taken_alone_from_beside_its_verdict(
    station: Station, opens: Opens, monkeypatch: pytest.MonkeyPatch
):
    def broken(found, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(found, air, view, moment)

    two_views(station)
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Capture")
    page.get_by_label("Frames to average").fill("4")
    with monkeypatch.context() as patch:
        patch.setattr("app.capture.views.open_camera", broken)
        page.get_by_role("button", name="Take reference").click()
        expect(page.locator(".desk")).to_contain_text("The second camera does not answer.")
    library = page.locator(".library")
    missing = library.get_by_role("group", name=VIEWS[1])
    expect(missing).to_contain_text("There is no picture yet of camera at x_max")
    snapshot(page, "views-missing")
    missing.get_by_role("button", name=f"Take {VIEWS[1]}").click()
    # Whole now; of a whole one any camera can be taken again, into a capture of its own.
    expect(library.get_by_role("img")).to_have_count(1)
    library.get_by_role("button", name=f"Take {VIEWS[0]} again").click()
    expect(library.get_by_role("img")).to_have_count(2)
    snapshot(page, "views-retaken")
    assert watched.complaints == []
