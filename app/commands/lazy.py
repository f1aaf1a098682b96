"""Commands that are known by name and sentence, and imported when they are run.

`airlens --help` and a shell's completion then load none of what the commands compute with.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup


class Deferred(TyperCommand):
    """A command whose module is imported when its options are needed, or it is run."""

    def __init__(self, name: str, module: str, about: str) -> None:
        super().__init__(name, help=about)
        self._named, self._module = name, module

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Begin the command itself: from here on this one is out of the way."""
        return commands_of(self._module)[self._named].make_context(info_name, args, parent, **extra)


def commands_of(module: str) -> Mapping[str, Any]:
    """The commands that a module registers, by name."""
    cli = typer.Typer(rich_markup_mode="markdown")
    cli.callback()(_nothing)
    importlib.import_module(module).register(cli)
    return typer.main.get_group(cli).commands


def lazy_group(table: Mapping[str, tuple[str, str]]) -> type[TyperGroup]:
    """A group of the commands of a table: name to module and what the command does."""

    class LazyGroup(TyperGroup):
        def __init__(
            self, *, commands: Mapping[str, Any] | Sequence[Any] | None = None, **named: Any
        ) -> None:
            known: dict[str, Any] = {
                name: Deferred(name, module, about) for name, (module, about) in table.items()
            }
            super().__init__(commands=known, **named)

    return LazyGroup


def _nothing() -> None: ...
