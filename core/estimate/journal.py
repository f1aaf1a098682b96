"""Marches in a store: their ends, and those that were cut, each under the digest of its inputs.

A march is a function of its inputs alone, bit for bit. So a solve that is begun again repeats its own steps, which
cost little, and takes from here every march that it has come by: no estimator need know of this.
"""

from collections.abc import Mapping

from core.checkpoint import claim, decode, encode, restore
from core.result import Outcome
from core.room.march import March, MarchState
from core.room.step import Flow
from core.watch import Store


class Journal:
    """What is kept of marches; without a store nothing is.

    Raises ForeignCheckpointError where the store holds marches of another configuration.
    """

    def __init__(self, store: Store | None, configuration: str) -> None:
        self._store, self._configuration = store, configuration
        if store is not None:
            claim(store, configuration)

    def ended(self, key: str, like: Flow) -> March | None:
        """The end of a march on the grid of `like`; None where it is not known."""
        content = None if self._store is None else self._store.get(f"march-{key}")
        if content is None:
            return None
        found = decode(content)
        blank = (like, like, 0.0, 0, 0.0, 0)
        last, mean, model_s, steps, change, windows = restore(found, blank, configuration=self._configuration)
        outcome = Outcome[found.header["shape"]["outcome"]]
        return March(last, mean, outcome, model_s, steps, change, windows)

    def keep_end(self, key: str, march: March) -> None:
        """Keep a march that has ended; what was kept of it on the way goes."""
        if self._store is None:
            return
        numbers = (march.model_s, march.steps, march.change, march.mean_windows)
        state = (march.last, march.mean, *numbers)
        shape = {"outcome": march.outcome.name}
        self._store[f"march-{key}"] = self._encoded(state, march.steps, shape)
        self._store.pop(f"cut-{key}", None)

    def cut(self, key: str, like: Flow) -> MarchState | None:
        """A march that did not end, as it was after its last window that was kept."""
        content = None if self._store is None else self._store.get(f"cut-{key}")
        if content is None:
            return None
        found = decode(content)
        blank = MarchState(like, (like,) * int(found.header["shape"]["means"]))
        return restore(found, blank, configuration=self._configuration)

    def keep_cut(self, key: str, state: MarchState) -> None:
        """Keep a march that is under way."""
        if self._store is not None:
            shape = {"means": len(state.means)}
            self._store[f"cut-{key}"] = self._encoded(state, state.windows, shape)

    def _encoded(self, state: object, step: int, shape: Mapping[str, int | str]) -> bytes:
        return encode(state, configuration=self._configuration, step=step, seed=0, history=[], shape=shape)
