"""Answers as they are written, changed one field at a time and checked as a file of answers is."""

import copy
import re
from collections.abc import Sequence
from typing import Any

from app.files.toml_places import Path
from app.setup.mistakes import mistakes_in

Tree = dict[str, Any]
_BARE = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)")


def value_at(tree: Any, path: Path) -> Any:
    """What is written there; None where nothing is."""
    for part in path:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def put(tree: Tree, path: Path, value: Any) -> None:
    """Write a value; None takes it away."""
    parent = value_at(tree, path[:-1])
    if value is None:
        parent.pop(path[-1], None)
    else:
        parent[path[-1]] = value


def changed(tree: Tree, values: Sequence[tuple[Path, Any]]) -> Tree:
    """The answers with other values; the old ones stay as they are."""
    after = copy.deepcopy(tree)
    for path, value in values:
        put(after, path, value)
    return after


def sentence_at(tree: Tree, *paths: Path, below: bool = True) -> str:
    """What is wrong at these places (and below them), in the words of a file's check; empty where nothing is."""
    found = [
        said.sentence
        for said in mistakes_in(tree)
        if any(said.path == path or (below and said.path[: len(path)] == path) for path in paths)
    ]
    return " ".join(dict.fromkeys(found))


def with_unit(text: str, unit: str) -> str:
    """A bare number has the usual unit."""
    plain = text.strip()
    return f"{plain} {unit}" if unit and _BARE.fullmatch(plain) else plain
