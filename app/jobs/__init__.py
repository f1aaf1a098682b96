"""Jobs: a ledger that loses nothing, a supervisor, and engines that only start and stop processes."""

from app.jobs.attended import attended
from app.jobs.config import JobsConfig, read_config
from app.jobs.errors import EngineError, FencedError, JobError, LedgerError, UnknownJobError
from app.jobs.ledger import Ledger
from app.jobs.records import Event, Group, Job, JobSpec
from app.jobs.state import JobState
from app.jobs.study import Summary, submit_ensemble, submit_sweep, summarise
from app.jobs.supervisor import Supervisor
from app.jobs.waiting import explained

__all__ = [
    "EngineError",
    "Event",
    "FencedError",
    "Group",
    "Job",
    "JobError",
    "JobSpec",
    "JobState",
    "JobsConfig",
    "Ledger",
    "LedgerError",
    "Summary",
    "Supervisor",
    "UnknownJobError",
    "attended",
    "explained",
    "read_config",
    "submit_ensemble",
    "submit_sweep",
    "summarise",
]
