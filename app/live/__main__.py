"""`python -m app.live`: reads orders line by line, tells what it sees line by line, and ends with its input.

An order is `{"experiment": folder}` to make ready, or with `"capture": folder` to look at a burst too. Of orders that
wait only the newest is carried out; how many were passed over is told.
"""

import json
import os
import sys
import threading
from pathlib import Path
from typing import Any, TextIO

from app.files.compilation_cache import use_compilation_cache

# Behind whatever takes pictures: a capture is never slowed by looking at it.
_NICER = 5


class Newest:
    """The newest order that nobody has taken yet, and how many bursts were passed over for it."""

    def __init__(self) -> None:
        self._there, self._order, self._skipped, self.ended = threading.Condition(), None, 0, False

    def put(self, order: dict[str, Any] | None) -> None:
        """A new order; None: there will be no more."""
        with self._there:
            if order is None:
                self.ended = True
            elif order.get("capture") or self._order is None:
                self._skipped += bool(self._order and self._order.get("capture"))
                self._order = order
            self._there.notify()

    def take(self) -> tuple[dict[str, Any], int] | None:
        """The newest order and the number passed over since the last one; waits for it; None at the end."""
        with self._there:
            self._there.wait_for(lambda: self._order is not None or self.ended)
            if self._order is None:
                return None
            order, skipped = self._order, self._skipped
            self._order, self._skipped = None, 0
            return order, skipped


def main(orders: TextIO, told: TextIO) -> None:
    """Carry out orders until they end."""
    newest = Newest()

    def read() -> None:
        for line in orders:
            newest.put(json.loads(line))
        newest.put(None)

    def tell(content: dict[str, Any]) -> None:
        told.write(json.dumps(content) + "\n")
        told.flush()

    threading.Thread(target=read, daemon=True).start()
    # Imported here: the array library takes seconds, and orders are heard meanwhile.
    from app.live.looking import Looking

    looking = Looking(tell)
    while (taken := newest.take()) is not None:
        order, skipped = taken
        capture = order.get("capture")
        looking.carry_out(Path(order["experiment"]), Path(capture) if capture else None, skipped)


if __name__ == "__main__":
    os.nice(_NICER)
    use_compilation_cache()
    main(sys.stdin, sys.stdout)
    sys.stdout.flush()
    os._exit(0)  # Taking the array library apart would take seconds.
