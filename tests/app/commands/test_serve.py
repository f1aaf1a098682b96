"""`airlens serve` as an operator starts it."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from app.cli import create_cli
from app.errors import BadInputError


def airlens(*arguments: str) -> list[str]:
    return [str(Path(sys.executable).with_name("airlens")), *arguments]


def test_serve_prints_an_address_whose_token_opens_the_service(tmp_path: Path):
    command = airlens("serve", str(tmp_path), "--port", "0", "--json")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            started = json.loads(process.stdout.readline())
            base, token = started["address"].split("/#token=")
            command_line = Path(f"/proc/{process.pid}/cmdline").read_bytes()
            assert token.encode() not in command_line
            answer = httpx.get(f"{base}/api/about", headers={"Authorization": f"Bearer {token}"}, timeout=100)
            assert answer.json()["data_root"] == str(tmp_path)
            assert httpx.get(f"{base}/api/about", timeout=100).status_code == 401
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=100)
    assert (tmp_path / "service" / "token").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("options", [["--host", "0.0.0.0"], ["--host", "0.0.0.0", "--expose"]])
def test_other_addresses_need_a_flag_and_tls(tmp_path: Path, options: list[str]):
    with pytest.raises(BadInputError, match="--tls-certificate"):
        create_cli()(["serve", str(tmp_path), *options], standalone_mode=False)


def test_a_token_that_others_can_read_is_refused(tmp_path: Path):
    folder = tmp_path / "service"
    folder.mkdir()
    (folder / "token").write_text("t" * 43)
    os.chmod(folder / "token", 0o644)
    with pytest.raises(BadInputError, match="--new-token"):
        create_cli()(["serve", str(tmp_path)], standalone_mode=False)
