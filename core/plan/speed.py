"""A preset's work, and how fast a machine does it: plain numbers, for those who do not wait for JAX."""

from dataclasses import dataclass

from core.setting import setting


@dataclass(frozen=True)
class Work:
    """The work of a preset and the size of its arrays, in units of its own loop."""

    loops: float
    size: float


@setting
class Speed:
    """One preset on one machine: seconds and megabytes as straight lines in its work and its size.

    The seconds are those of solving alone, without compiling.
    """

    fixed_s: float
    s_per_work: float
    fixed_mb: float
    mb_per_size: float

    def seconds(self, work: Work) -> float:
        """Solver time."""
        return self.fixed_s + self.s_per_work * work.loops

    def megabytes(self, work: Work) -> float:
        """Peak memory."""
        return self.fixed_mb + self.mb_per_size * work.size
