"""The states of a job: one enum, shown by the same words everywhere."""

from enum import StrEnum


class JobState(StrEnum):
    """Where a job is.

    queued -> running -> done | failed
    running -> lost -> running            the worker vanished; tried again after a back-off
    running -> pausing -> paused -> queued (resume)
    running -> cancelling -> cancelled -> queued (retry: goes on from its checkpoint)
    """

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


ACTIVE = (JobState.running, JobState.pausing, JobState.cancelling)
WAITING = (JobState.queued, JobState.lost)
FINISHED = (JobState.done, JobState.failed, JobState.cancelled)
