"""Why a job waits, in words: what the ledger's row cannot know is added when it is shown."""

from collections.abc import Sequence
from dataclasses import replace

from app.jobs.folder import is_held, last_lines
from app.jobs.ledger import Ledger
from app.jobs.records import Job
from app.jobs.state import ACTIVE, WAITING, JobState

SUPERVISOR_LOCK = "supervisor.lock"
SUPERVISOR_LOG = "supervisor.log"


def explained(ledger: Ledger, jobs: Sequence[Job]) -> list[Job]:
    """Return the jobs; each one that waits, or is to be stopped, says why it still does."""
    if not any(_waits(job) for job in jobs):
        return list(jobs)
    nobody = _nobody(ledger)
    active = [] if nobody else ledger.jobs(states=ACTIVE)
    return [replace(job, reason=_why(job, nobody, active)) if _waits(job) else job for job in jobs]


def _waits(job: Job) -> bool:
    return job.state in (*WAITING, JobState.pausing, JobState.cancelling)


def _nobody(ledger: Ledger) -> str:
    """Return what to do when no supervisor runs here, or an empty string."""
    if is_held(ledger.folder / SUPERVISOR_LOCK):
        return ""
    words = last_lines(ledger.folder / SUPERVISOR_LOG)
    return "No supervisor runs these jobs now. Start `airlens jobs run` or `airlens serve`." + (
        f" The last one said: {words}" if words else ""
    )


def _why(job: Job, nobody: str, active: Sequence[Job]) -> str:
    if nobody:
        return f"{job.reason} {nobody}".strip()
    if job.reason:
        return job.reason
    if job.state in (JobState.pausing, JobState.cancelling):
        return "Waiting for the worker to write its checkpoint and end."
    if active:
        taken = ", ".join(f"{other.device} by {other.title} ({other.id})" for other in active[:4])
        return f"Waiting for a free device. Taken: {taken}."
    return "Waiting for the supervisor's next look at the queue."
