"""Where each key and value of a TOML text stands: line and column, from 1.

The text is known to be valid (tomllib read it), so that this only has to find its way: tables, arrays of tables,
dotted and quoted keys, strings of four kinds, arrays and inline tables. Source: TOML 1.0.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

Path = tuple[str | int, ...]

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}'
    r"|'''.*?'{3,5}"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_SCALAR = re.compile(r"[^,\]}#\n]+")


@dataclass(frozen=True)
class KeyPlace:
    """Line and column of a key (or a table's header), and of its value."""

    key: tuple[int, int]
    value: tuple[int, int]


def places_of(text: str) -> Mapping[Path, KeyPlace]:
    """The place of every key, table and item of an array, by its path; none at all of a text that is no TOML."""
    try:
        return _Reader(text).read()
    except (IndexError, ValueError):
        return {}


def nearest(places: Mapping[Path, KeyPlace], path: Path) -> tuple[Path, KeyPlace] | None:
    """The place of a path, or of the last table above it that is written."""
    for length in range(len(path), 0, -1):
        if path[:length] in places:
            return path[:length], places[path[:length]]
    return None


class _Reader:
    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self._lines = [0, *(match.end() for match in re.finditer("\n", text))]
        self._places: dict[Path, KeyPlace] = {}
        self._arrays: dict[Path, int] = {}

    def read(self) -> dict[Path, KeyPlace]:
        table: Path = ()
        self._blank()
        while self._at < len(self._text):
            if self._text[self._at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._blank()
        return self._places

    def _header(self) -> Path:
        start, many = self._at, self._text.startswith("[[", self._at)
        self._at += 2 if many else 1
        names = self._names()
        self._at += 2 if many else 1
        path: Path = ()
        for number, name in enumerate(names):
            path = (*path, name)
            if number < len(names) - 1:
                self._note(path, start, start)
            if path in self._arrays and not (many and number == len(names) - 1):
                path = (*path, self._arrays[path])
        if many:
            self._arrays[path] = self._arrays.get(path, -1) + 1
            self._note(path, start, start)
            path = (*path, self._arrays[path])
        self._note(path, start, start)
        return path

    def _pair(self, table: Path) -> None:
        """`key = value`, the key dotted or not."""
        start = self._at
        path = (*table, *self._names())
        self._expect("=")
        self._blank()
        for length in range(len(table) + 1, len(path) + 1):
            self._note(path[:length], start, self._at if length == len(path) else start)
        self._value(path)

    def _names(self) -> list[str]:
        names = []
        while True:
            self._blank()
            quoted = _STRING.match(self._text, self._at)
            found = quoted or _BARE.match(self._text, self._at)
            if found is None:
                raise ValueError(f"no key at {self._at}")
            names.append(found[0][1:-1] if quoted else found[0])
            self._at = found.end()
            self._blank()
            if self._text[self._at] != ".":
                return names
            self._at += 1

    def _value(self, path: Path) -> None:
        opening = self._text[self._at]
        if opening == "[":
            self._items(path)
        elif opening == "{":
            self._inline(path)
        else:
            found = _STRING.match(self._text, self._at) or _SCALAR.match(self._text, self._at)
            if found is None:
                raise ValueError(f"no value at {self._at}")
            self._at = found.end()

    def _items(self, path: Path) -> None:
        self._at += 1
        number = 0
        while self._more("]"):
            self._note((*path, number), self._at, self._at)
            self._value((*path, number))
            number += 1
            self._comma()

    def _inline(self, path: Path) -> None:
        self._at += 1
        while self._more("}"):
            self._pair(path)
            self._comma()

    def _more(self, end: str) -> bool:
        self._blank()
        if self._text[self._at] != end:
            return True
        self._at += 1
        return False

    def _comma(self) -> None:
        self._blank()
        if self._text[self._at] == ",":
            self._at += 1

    def _expect(self, character: str) -> None:
        if self._text[self._at] != character:
            raise ValueError(f"expected {character} at {self._at}")
        self._at += 1

    def _blank(self) -> None:
        found = _BLANK.match(self._text, self._at)
        self._at = found.end() if found else self._at

    def _note(self, path: Path, key: int, value: int) -> None:
        self._places.setdefault(path, KeyPlace(self._line_of(key), self._line_of(value)))

    def _line_of(self, at: int) -> tuple[int, int]:
        line = self._text.count("\n", 0, at)
        return line + 1, at - self._lines[line] + 1
