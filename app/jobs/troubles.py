"""What one job's trouble means, so that no job keeps a round of the supervisor from the others."""

import errno
import logging
import time
from collections.abc import Callable

from app.errors import AirlensError
from app.jobs.dispatch import Dispatch
from app.jobs.errors import LedgerError
from app.jobs.records import Job
from app.jobs.state import JOB, JobEvent, JobState

_log = logging.getLogger(__name__)
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


class Troubles:
    """Does something for one job; whatever that raises stays with this job.

    A full disk or ledger is waited for. Another error of the system is, too, for `patience_s`. Any other
    exception fails the job with its reason.
    """

    def __init__(self, dispatch: Dispatch, patience_s: float, kill: Callable[[Job], None]) -> None:
        self._dispatch, self._patience_s, self._kill = dispatch, patience_s, kill
        self._since_s: dict[str, float] = {}
        self.met = ""

    def alone(self, job: Job, act: Callable[[Job], bool]) -> bool:
        """Return what `act(job)` returns, False when it raised; `met` then holds the newest trouble."""
        try:
            done = act(job)
            self._since_s.pop(job.id, None)
            return done
        except LedgerError as error:
            self._note(job, error)
        except OSError as error:
            self._note(job, error)
            since_s = self._since_s.setdefault(job.id, time.monotonic())
            if error.errno not in FULL and time.monotonic() - since_s > self._patience_s:
                self._break_off(job, f"{error}. This lasted for {self._patience_s:g} s.")
            else:
                self._explain(job, f"Waiting: {error}. It goes on by itself when this is mended.")
        except AirlensError as error:
            self._note(job, error)
            self._break_off(job, str(error))
        except Exception as error:
            _log.exception("job %s", job.id)
            self.met = str(error)
            reason = f"{type(error).__name__}: {error}. This is a defect; the supervisor's log has the trace."
            self._break_off(job, reason)
        return False

    def _note(self, job: Job, error: Exception) -> None:
        self.met = str(error)
        _log.error("job %s: %s", job.id, error)

    def _break_off(self, job: Job, reason: str) -> None:
        """End the job; one that was to be cancelled is."""
        try:
            now = self._dispatch.now(job)  # it may have begun meanwhile
            event = JobEvent.end if now.state is JobState.cancelling else JobEvent.fail
            if now.state.is_active:
                self._kill(now)
            if JOB.allows(now.state, event):
                self._dispatch.move(now, event, reason)
            self._since_s.pop(job.id, None)
        except Exception as error:  # the ledger is full, most likely: the next round tries again
            self._note(job, error)

    def _explain(self, job: Job, reason: str) -> None:
        try:
            self._dispatch.explain(job, reason)
        except LedgerError as error:
            self._note(job, error)
