"""A machine of states as a table: what may happen in which state, and where it leads.

What the table does not name is refused with a sentence. So a state is never left by a way that nobody
thought of, and each way out of it can be read, and walked by a test.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

S = TypeVar("S", bound=StrEnum)
E = TypeVar("E", bound=StrEnum)


@dataclass(frozen=True)
class StateMachine(Generic[S, E]):
    """States, events and what follows; `asked` are the events that a person asks for.

    Raises `error` for an event that means nothing in a state.
    """

    name: str
    table: Mapping[S, Mapping[E, S]]
    asked: frozenset[E]
    error: type[Exception]

    def after(self, state: S, event: E, who: str = "") -> S:
        """Return the state that follows. `who` names the thing in the refusal."""
        following = self.table[state].get(event)
        if following is None:
            raise self.error(self.refusal(state, event, who))
        return following

    def allows(self, state: S, event: E) -> bool:
        """True when the event means something in the state."""
        return event in self.table[state]

    def refusal(self, state: S, event: E, who: str = "") -> str:
        """Say why not, and what is possible."""
        possible = [str(one) for one in self.table[state] if one in self.asked]
        ends = "Wait until it has ended, or stop it." if self.table[state] else "It stays so."
        ways = f"What can be asked of it now: {', '.join(possible)}." if possible else ends
        return f"{who or self.name} is {state}: there is nothing to {event}. {ways}"

    def reachable(self, state: S) -> set[S]:
        """Return every state that some events lead to from `state`, itself included."""
        found, open_ends = {state}, [state]
        while open_ends:
            for following in self.table[open_ends.pop()].values():
                if following not in found:
                    found.add(following)
                    open_ends.append(following)
        return found
