"""`airlens remote` against a live service."""

import json

import pytest

from app.cli import create_cli
from app.client import ServiceError
from app.errors import BadInputError
from tests.app.api.conftest import Live


@pytest.fixture
def remote(live: Live, capsys: pytest.CaptureFixture[str]):
    def ask(*arguments: str) -> list:
        address = f"{live.url}/#token={live.token}"
        create_cli()(["remote", *arguments, "--address", address], standalone_mode=False)
        return [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    return ask


def test_a_shell_asks_what_the_page_asks(remote):
    made = remote("create_experiment", "camera_px=64", "title=From a shell")[0]
    assert made["title"] == "From a shell"
    assert [one["experiment"] for one in remote("experiments")[0]] == [made["experiment"]]


def test_without_a_request_it_lists_what_can_be_asked(capsys: pytest.CaptureFixture[str]):
    create_cli()(["remote"], standalone_mode=False)
    assert "start_capture(self, experiment" in capsys.readouterr().out


def test_a_refusal_is_told(remote):
    with pytest.raises(ServiceError, match="There is no job"):
        remote("job", "job=j-none")
    with pytest.raises(BadInputError, match="cannot be asked"):
        remote("nothing")
