"""A few walks; two thousand of them: tests/benchmarks/walks.py."""

from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.walks.faults import silent_deaths
from tests.walks.walk import TALLY, Walk

QUIET = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}


def test_no_walk_ends_in_a_state_without_a_way_out_and_none_loses_what_was_acknowledged():
    before = TALLY["walks"]
    with silent_deaths():
        run_state_machine_as_test(
            Walk, settings=settings(max_examples=40, stateful_step_count=30, derandomize=True, **QUIET)
        )
    assert TALLY["walks"] - before >= 40
