"""What can go wrong with jobs.

AirlensError
├── JobError            a job cannot do what was asked of it now
│   ├── UnknownJobError
│   └── FencedError     this attempt was replaced; its writes are refused
├── LedgerError         the ledger cannot be read or written
└── EngineError         a compute engine did not start, stop or report a process
"""

from app.errors import AirlensError


class JobError(AirlensError):
    """A job is in a state in which the request means nothing."""


class UnknownJobError(JobError):
    """No job has this id."""


class FencedError(JobError):
    """A newer attempt owns the job: this one must not write any more."""


class LedgerError(AirlensError):
    """The ledger cannot be read or written: disk full, wrong schema, locked."""


class EngineError(AirlensError):
    """A compute engine is not there, refused, or is not safe to use."""
