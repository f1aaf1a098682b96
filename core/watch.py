"""What a solve tells while it runs, how it is asked to stop, and where it keeps what it can go on from."""

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass

from core.result import Solution

# Numbers and words of one moment. Every solver says `doing`, in words; `share`, from 0 to 1, where it can tell how
# much of its work is done; and `elapsed_s`.
Row = Mapping[str, float | str]
# The air as far as it has come: worked out only for a watcher who looks.
Growing = Callable[[], Solution]
# Named blobs. Setting one is durable, whole or not at all; a `dict` serves where nothing need outlive the process.
Store = MutableMapping[str, bytes]


class StoppedError(Exception):
    """A solve ended because it was asked to. The same solve with the same store goes on from there."""

    def __init__(self) -> None:
        super().__init__("Stopped on request. The same again goes on from what was kept.")


@dataclass(frozen=True)
class Watch:
    """The same for every solver: who is told, who may stop it, where it keeps its state.

    A solver asks `should_stop` at least every few seconds, but for compilation, which nothing interrupts.
    """

    on_row: Callable[[Row, Growing | None], object] = lambda row, growing: None
    should_stop: Callable[[], bool] = lambda: False
    store: Store | None = None

    def tell(self, row: Row, growing: Growing | None = None) -> None:
        """Tell a row, with the air as it is now where that can be had."""
        self.on_row(row, growing)

    def check_stop(self) -> None:
        """Raise StoppedError when a stop was asked for. Whoever has something to keep keeps it then."""
        if self.should_stop():
            raise StoppedError
