"""One field asked: its default from the answers so far, its check the one that a file of answers goes through."""

from collections.abc import Generator, Sequence
from typing import Any

from app.interview.conversation import Again, Question, Remark
from app.interview.tree import Path, Tree, changed, put, sentence_at, value_at, with_unit
from app.setup.units import UNITS, unit_of

Asked = Generator[Question | Remark | Again, str, Any]
# What leaves a field open that may be open.
NOTHING = "none"


def ask_field(tree: Tree, path: Path, text: str, unit: str = "", can_be_open: bool = False) -> Asked:
    """Ask for a text or a value with its unit; a bare number has the usual one."""

    def check(line: str) -> str:
        if can_be_open and line == NOTHING:
            return line
        written = with_unit(line, unit)
        _refuse(sentence_at(changed(tree, [(path, written)]), path))
        return written

    written = value_at(tree, path)
    default = str(written) if written is not None else NOTHING if can_be_open else ""
    answer = yield Question(text + (f" (or {NOTHING})" if can_be_open else ""), check, default)
    put(tree, path, None if can_be_open and answer == NOTHING else answer)


def ask_number(tree: Tree, path: Path, text: str) -> Asked:
    """Ask for a whole number."""

    def check(line: str) -> str:
        _refuse(sentence_at(changed(tree, [(path, _whole(line))]), path))
        return line

    answer = yield Question(text, check, str(value_at(tree, path) or ""))
    put(tree, path, _whole(answer))


def ask_either(tree: Tree, parent: Path, text: str, ways: Sequence[tuple[str, str]]) -> Asked:
    """Ask for one of several fields; the unit tells which. `ways` are fields, each with its usual unit.

    Returns the field that was answered; the others are taken away.
    """

    def put_one(line: str) -> tuple[str, str, Tree]:
        name = _way(line, ways)
        written = with_unit(line, dict(ways)[name])
        others = [((*parent, other), None) for other, _ in ways if other != name]
        return name, written, changed(tree, [*others, ((*parent, name), written)])

    def check(line: str) -> str:
        name, written, after = put_one(line)
        _refuse(sentence_at(after, (*parent, name)))
        return written

    there = [value_at(tree, (*parent, name)) for name, _ in ways]
    answer = yield Question(text, check, next((str(one) for one in there if one is not None), ""))
    name, _, after = put_one(answer)
    tree.clear()
    tree.update(after)
    return name


def ask_position(tree: Tree, path: Path, name: str) -> Asked:
    """Ask for the x, y and z [m] of the thing at `path`."""
    for axis in range(3):
        yield from ask_field(tree, (*path, "position", axis), f"{name}: {'xyz'[axis]}", "m")


def ask_temperature(tree: Tree, path: Path, name: str, deviation: str, can_be_open: bool = False) -> Asked:
    """Ask for the temperature [C] of the thing at `path` and, unless it stays open, for its deviation [K]."""
    yield from ask_field(tree, (*path, "temperature"), f"{name}: temperature", "C", can_be_open)
    if value_at(tree, (*path, "temperature")) is not None:
        value_at(tree, path).setdefault("temperature_deviation", deviation)
        yield from ask_field(
            tree, (*path, "temperature_deviation"), f"{name}: temperature, give or take", "K"
        )


def ask_choice(text: str, options: Sequence[str], default: str = "", about: Sequence[str] = ()) -> Asked:
    """Ask for one of the options, by its number or its name; return its name. `about` says more of each."""

    def check(line: str) -> str:
        if line in options:
            return line
        if line.isdecimal() and 1 <= int(line) <= len(options):
            return options[int(line) - 1]
        raise ValueError(f"{line!r} is none of them; expected 1 to {len(options)}, or {', '.join(options)}.")

    lines = tuple(
        f"{one}  {more}".strip() for one, more in zip(options, about or [""] * len(options), strict=True)
    )
    return (yield Question(text, check, default or options[0], lines))


def ask_count(tree: Tree, text: str, default: int, checked: Path, *places: Path) -> Asked:
    """Ask how many things of a kind there are: the list at `checked` has so many empty things while it is checked."""

    def check(line: str) -> str:
        after = changed(tree, [(checked, [{}] * _whole(line))])
        _refuse(sentence_at(after, checked, *places, below=False))
        return line

    return int((yield Question(text, check, str(default))))


def _refuse(sentence: str) -> None:
    if sentence:
        raise ValueError(sentence)


def _whole(line: str) -> int:
    if not line.isdecimal():
        raise ValueError(f"{line!r} is no whole number; expected one such as 2.")
    return int(line)


def _way(line: str, ways: Sequence[tuple[str, str]]) -> str:
    """The field whose usual unit measures the same as the unit that was written."""
    kinds = {unit: kind for kind, units in UNITS.items() for unit in units}
    for name, unit in ways:
        if unit_of(line) in UNITS[kinds[unit]]:
            return name
    return ways[0][0]
