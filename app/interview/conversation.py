"""A conversation: questions one after another, each answer checked before the next is asked.

What was answered is kept as lines. To go on after an interruption, or to go back, the lines that are kept are
answered again by themselves, and the next question is put. So a file of such lines, piped in, says the same.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from app.errors import BadInputError
from app.files.durable import write_text
from app.files.reading import reading

DRAFT_FILE = "conversation.txt"
BACK = "back"
# Begins a line that is no answer.
NOTE = "#"


@dataclass(frozen=True)
class Question:
    """What is asked. Enter takes `default`; `check` returns the answer as it is kept, or raises ValueError."""

    text: str
    check: Callable[[str], str]
    default: str = ""
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Remark:
    """Something to know before the next question."""

    text: str


@dataclass(frozen=True)
class Again:
    """The last `questions` answers cannot all be true: they are asked again."""

    reason: str
    questions: int


# Yields what is asked and told, is sent each answer, and returns what all answers make.
Flow = Generator[Question | Remark | Again, str, dict[str, Any]]


class Person(Protocol):
    """Who answers."""

    def hear(self, question: Question) -> str:
        """The answer to a question; empty for its default. Raises EOFError where nothing more comes."""
        ...

    def say(self, text: str) -> None:
        """Tell something."""
        ...

    def refuse(self, question: Question | None, reason: str) -> None:
        """Tell why an answer is not taken. Raises BadInputError where nobody is there to give another one."""
        ...


class _BackError(Exception):
    """So many answers are forgotten."""

    def __init__(self, questions: int) -> None:
        super().__init__()
        self.questions = questions


def converse(flow: Callable[[], Flow], person: Person, draft: Path) -> dict[str, Any]:
    """What the answers make; every answer is in `draft` before the next question. Raises EOFError, BadInputError."""
    kept = read_lines(draft)
    while True:
        try:
            return _walk(flow(), kept, person, draft)
        except _BackError as back:
            del kept[max(0, len(kept) - back.questions) :]
            _keep(draft, kept)


def read_lines(draft: Path) -> list[tuple[str, str]]:
    """The answers that are kept, each with its question."""
    if not draft.is_file():
        return []
    with reading(draft, "Remove the file to begin anew."):
        lines = draft.read_text(encoding="utf-8").splitlines()
    asked = [line.removeprefix(f"{NOTE} ") for line in lines if line.startswith(NOTE)]
    answered = [line for line in lines if not line.startswith(NOTE)]
    return list(zip(asked, answered, strict=False))


def _keep(draft: Path, kept: list[tuple[str, str]]) -> None:
    if kept:
        write_text(draft, "".join(f"{NOTE} {asked}\n{answer}\n" for asked, answer in kept))
    else:
        draft.unlink(missing_ok=True)


def _walk(talk: Flow, kept: list[tuple[str, str]], person: Person, draft: Path) -> dict[str, Any]:
    given, item = 0, next(talk)
    try:
        while True:
            if isinstance(item, Again):
                person.refuse(None, item.reason)
                raise _BackError(item.questions)
            if isinstance(item, Remark):
                if given == len(kept):
                    person.say(item.text)
                item = next(talk)
                continue
            answer = _known(item, kept, given)
            if answer is None:
                answer = _asked(item, person)
                kept.append((item.text, answer))
                _keep(draft, kept)
            given += 1
            item = talk.send(answer)
    except StopIteration as end:
        return end.value


def _known(question: Question, kept: list[tuple[str, str]], given: int) -> str | None:
    """A kept answer to this very question, where it still holds; else it and all after it are forgotten."""
    if given < len(kept) and kept[given][0] == question.text:
        try:
            return question.check(kept[given][1])
        except ValueError:
            pass
    del kept[given:]
    return None


def _asked(question: Question, person: Person) -> str:
    while True:
        line = person.hear(question).strip()
        if line == BACK:
            raise _BackError(1)
        try:
            if line.startswith(NOTE):
                raise ValueError(f"An answer does not begin with {NOTE}: that is a note.")
            return question.check(line or question.default)
        except ValueError as error:
            person.refuse(question, str(error))


class Piped:
    """Answers that are fed in, a line each; lines that begin with # are notes."""

    def __init__(self, lines: Callable[[], str]) -> None:
        self._lines, self._number = lines, 0

    def hear(self, question: Question) -> str:
        """The next line."""
        while True:
            self._number += 1
            line = self._lines()
            if not line:
                raise EOFError(question.text)
            if not line.startswith(NOTE):
                return line

    def say(self, text: str) -> None:
        """Nobody listens."""

    def refuse(self, question: Question | None, reason: str) -> None:
        """Raises BadInputError: the lines after a wrong one would answer other questions."""
        asked = "" if question is None else f", the answer to {question.text!r}"
        raise BadInputError(f"standard input, line {self._number}{asked}: {reason}")
