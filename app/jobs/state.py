"""The states of a job, shown by the same words everywhere, and the one table of what leads where."""

from enum import StrEnum

from app.jobs.errors import JobError
from app.states import StateMachine


class JobState(StrEnum):
    """Where a job is; `TABLE` says what leads from one to the other."""

    queued = "queued"
    running = "running"
    pausing = "pausing"
    cancelling = "cancelling"
    paused = "paused"
    lost = "lost"
    done = "done"
    failed = "failed"
    cancelled = "cancelled"

    @property
    def is_active(self) -> bool:
        """True while the job holds a device."""
        return self in ACTIVE

    @property
    def is_finished(self) -> bool:
        """True when nothing more happens unless someone asks for it."""
        return self in FINISHED


class JobEvent(StrEnum):
    """What happens to a job: the first four are the supervisor's to say, the others are asked for."""

    begin = "begin"
    finish = "finish"
    fail = "fail"
    end = "end"
    cancel = "cancel"
    pause = "pause"
    resume = "resume"
    retry = "retry"


ACTIVE = (JobState.running, JobState.pausing, JobState.cancelling)
WAITING = (JobState.queued, JobState.lost)
FINISHED = (JobState.done, JobState.failed, JobState.cancelled)

_S, _E = JobState, JobEvent
JOB = StateMachine(
    name="The job",
    table={
        _S.queued: {_E.begin: _S.running, _E.fail: _S.failed, _E.cancel: _S.cancelled, _E.pause: _S.paused},
        _S.running: {
            _E.finish: _S.done,
            _E.fail: _S.failed,
            _E.end: _S.lost,
            _E.cancel: _S.cancelling,
            _E.pause: _S.pausing,
        },
        _S.lost: {
            _E.begin: _S.running,
            _E.fail: _S.failed,
            _E.cancel: _S.cancelled,
            _E.pause: _S.paused,
            _E.retry: _S.queued,
        },
        _S.pausing: {
            _E.finish: _S.done,
            _E.fail: _S.failed,
            _E.end: _S.paused,
            _E.cancel: _S.cancelling,
            _E.pause: _S.pausing,
        },
        _S.cancelling: {
            _E.finish: _S.done,
            _E.fail: _S.failed,
            _E.end: _S.cancelled,
            _E.cancel: _S.cancelling,
        },
        _S.paused: {_E.resume: _S.queued, _E.cancel: _S.cancelled, _E.pause: _S.paused},
        _S.failed: {_E.retry: _S.queued},
        _S.cancelled: {_E.retry: _S.queued, _E.cancel: _S.cancelled},
        _S.done: {},
    },
    asked=frozenset({_E.cancel, _E.pause, _E.resume, _E.retry}),
    error=JobError,
)
