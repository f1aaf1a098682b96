"""How a run of tests is divided between workers: module by module, and some modules to one, the longest first.

A browser test waits for whole solves and draws in software. Several at once wait for one another beyond their limits.
The stories of `_TOLD` share one result. A long module that begins last would keep one worker busy while others idle.
"""

import pytest
from xdist.scheduler import LoadScopeScheduling

_BROWSER = "tests/browser/"
_TOLD = ("tests/story/test_chain.py", "tests/story/test_road.py", "tests/story/test_rig_commands.py")
# What takes minutes a module, the longest first.
_LONG = (
    _BROWSER,
    "tests/story/",
    "tests/core/solve/",
    "tests/app/calibrate/test_terminal.py",
    "tests/app/jobs/",
    "tests/core/plan/",
    "tests/calibration/",
    "tests/extremes/",
)


class _Scheduling(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        if nodeid.startswith(_BROWSER):
            return _BROWSER
        return _TOLD[0] if nodeid.startswith(_TOLD) else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The scheduler of `--dist loadscope`; None leaves other ways of dividing as they are."""
    if config.getoption("dist") != "loadscope":
        return None
    config.option.loadscopereorder = False  # by the number of tests, of which a long module may have two
    return _Scheduling(config, log)


def pytest_collection_modifyitems(items):
    """The longest modules first."""
    items.sort(
        key=lambda item: next((i for i, long in enumerate(_LONG) if item.nodeid.startswith(long)), len(_LONG))
    )
