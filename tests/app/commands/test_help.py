"""What `--help` says, of every command: it keeps the units of what is asked."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from app.cli import create_cli


def commands(path: tuple[str, ...] = (), command: Any = None) -> Iterator[tuple[str, ...]]:
    """The words of every command, of groups too."""
    yield path
    for name, below in getattr(own(command), "commands", {}).items():
        yield from commands((*path, name), below)


def own(command: Any = None) -> Any:
    """The command itself, which a deferred one stands for."""
    command = command or typer.main.get_command(create_cli())
    return command.make_context("airlens", [], resilient_parsing=True).command


@pytest.mark.parametrize("path", list(commands()), ids=lambda path: " ".join(path) or "airlens")
def test_the_help_of_a_command_has_every_unit_that_it_asks_for(path):
    done = CliRunner().invoke(create_cli(), [*path, "--help"])
    assert done.exit_code == 0, done.output
    command = typer.main.get_command(create_cli())
    for word in path:
        command = own(command).commands[word]
    asked = " ".join(getattr(one, "help", None) or "" for one in own(command).params)
    for unit in re.findall(r"\[[^\]]+\]", asked):
        assert unit in done.output, unit
