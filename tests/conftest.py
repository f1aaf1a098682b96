"""Strict JAX for every test: ranks and dtypes never promote silently. Options name real devices."""

import signal

import jax

from tests.extremes.summary import pytest_runtest_logreport, pytest_terminal_summary
from tests.memory import compiled_programs, pytest_configure
from tests.shapes import check_each_once
from tests.workers import pytest_collection_modifyitems, pytest_xdist_make_scheduler

__all__ = [
    "compiled_programs",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_runtest_logreport",
    "pytest_terminal_summary",
    "pytest_xdist_make_scheduler",
]

check_each_once()
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")

# A shell that runs tests in the background makes them, and every program that they start, ignore Ctrl-C.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--camera", help="a V4L2 device for the hardware half of the camera contract")
    parser.addoption("--projector", help="URL of a projector for the hardware half of its contract")
    parser.addoption("--extremes-table", help="write every row of tests/extremes to this file (Markdown)")
    parser.addoption("--memory-table", help="write memory and CPU time after each module to this file")
