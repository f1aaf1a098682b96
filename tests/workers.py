"""How a run of tests is divided between workers: module by module, and all browser tests to one.

A browser test waits for whole solves and draws in software. Several at once wait for one another beyond their limits,
and `loadscope` alone would start them all at the end of a run.
"""

import pytest
from xdist.scheduler import LoadScopeScheduling

_TOGETHER = "tests/browser/"


class _Scheduling(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        return _TOGETHER if nodeid.startswith(_TOGETHER) else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The scheduler of `--dist loadscope`; None leaves other ways of dividing as they are."""
    return _Scheduling(config, log) if config.getoption("dist") == "loadscope" else None
