"""The marches of one solve: told while they run, stopped on request, kept in a journal, and counted."""

import threading
import time
from collections.abc import Callable

import numpy as np

from core.checkpoint import digest
from core.estimate.journal import Journal
from core.room.march import March, MarchSettings, MarchState, march
from core.room.room_grid import RoomGrid
from core.room.step import Flow, RoomModel
from core.watch import Growing, Row, StoppedError, Watch

# A march that is under way is kept so often, and for at most a hundredth of the time.
_KEPT_EVERY_S, _COST = 10.0, 0.01
# How long a fit will be is an estimate: until it has ended it is not said to be done.
_NEARLY = 0.99


def work(grid: RoomGrid, seconds: float) -> float:
    """Cells times time steps of a march, but for a factor that is the same for all grids of a room."""
    return float(np.prod(grid.cells)) * seconds / min(grid.spacing_m)


class Marches:
    """Runs marches for a fit, each only once for one `configuration`; `history` are the rows that are recorded."""

    def __init__(self, watch: Watch = Watch(), configuration: str = "") -> None:
        self.history: list[dict[str, float | str]] = []
        self._watch, self._journal = watch, Journal(watch.store, configuration)
        self._began_s, self._expected, self._done = time.perf_counter(), 0.0, 0.0
        self._lock = threading.Lock()

    @property
    def elapsed_s(self) -> float:
        """Seconds since this process began with them."""
        return time.perf_counter() - self._began_s

    def expect(self, more: float) -> None:
        """So much `work` is to come from now on; what was expected before has ended."""
        with self._lock:
            self._expected = self._done + more

    def forgo(self, less: float) -> None:
        """So much of the expected `work` will not come."""
        with self._lock:
            self._expected -= less

    def tell(self, row: Row, growing: Growing | None = None, *, under_way: float = 0.0) -> Row:
        """Tell a row, with the time and the share of the work that is done; the told row."""
        share = (self._done + under_way) / self._expected if self._expected else 0.0
        told = {**row, "share": min(share, _NEARLY), "elapsed_s": self.elapsed_s}
        self._watch.tell(told, growing)
        return told

    def record(self, row: Row) -> None:
        """Tell a row, and keep it in the history without its share, which depends on what threads do beside."""
        self.history.append({name: value for name, value in self.tell(row).items() if name != "share"})

    def run(
        self,
        flow: Flow,
        model: RoomModel,
        settings: MarchSettings,
        *,
        counted: float = 0.0,
        on_window: Callable[[MarchState], object] = lambda state: None,
    ) -> March:
        """The march's end, from the journal or by marching; `counted` is its `work`. Raises StoppedError."""
        self._watch.check_stop()
        key = digest(flow, model, settings)
        found = self._journal.ended(key, flow)
        if found is None:
            found = self._marched(key, flow, model, settings, on_window)
        with self._lock:
            self._done += counted
        return found

    def _marched(self, key: str, flow: Flow, model: RoomModel, settings: MarchSettings, on_window) -> March:
        keeper = _Keeper(self._journal, key)

        def passed(state: MarchState) -> None:
            keeper.passed(state)
            on_window(state)

        begun = self._journal.cut(key, flow)
        try:
            found = march(
                flow,
                model,
                settings,
                begun=begun,
                on_window=passed,
                check_stop=self._watch.check_stop,
            )
        except StoppedError:
            keeper.keep()
            raise
        self._journal.keep_end(key, found)
        return found


class _Keeper:
    """Keeps a march that is under way, now and then and when it is stopped."""

    def __init__(self, journal: Journal, key: str) -> None:
        self._journal, self._key = journal, key
        self._state: MarchState | None = None
        self._kept_s, self._cost_s = time.perf_counter(), 0.0

    def passed(self, state: MarchState) -> None:
        """A window is over."""
        self._state = state
        if time.perf_counter() - self._kept_s >= max(_KEPT_EVERY_S, self._cost_s / _COST):
            self.keep()

    def keep(self) -> None:
        """Keep what has not been kept."""
        if self._state is not None:
            began_s = time.perf_counter()
            self._journal.keep_cut(self._key, self._state)
            self._kept_s = time.perf_counter()
            self._cost_s, self._state = self._kept_s - began_s, None
