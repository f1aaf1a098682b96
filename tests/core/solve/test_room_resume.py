"""A room's fit that is stopped anywhere goes on to the same bits, and says meanwhile what it does."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from core.checkpoint import ForeignCheckpointError
from core.problem import Problem
from core.result import Solution
from core.solve.room import RoomSettings, solve_room
from core.watch import StoppedError, Watch
from tests.core.solve.test_room import SUPPLY, measured, scene

SETTINGS = RoomSettings(
    cells=8,
    coarse_cells=6,
    vertices=9,
    settle_s=60.0,
    restart_s=30.0,
    restart_walls_s=30.0,
    refine_s=30.0,
    rounds=2,
)


class Asked:
    """Asks to stop at the n-th question and ever after; counts the questions."""

    def __init__(self, n: float) -> None:
        self.count, self._n = 0, n

    def __call__(self) -> bool:
        self.count += 1
        return self.count > self._n


def same(a: Solution, b: Solution) -> None:
    for name in ("temperature_k", "pressure_m2_s2", "velocity_m_s", "temperature_std_k", "velocity_std_m_s"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.notes == b.notes


def timeless(solution: Solution) -> list[dict]:
    """The history but for the clock."""
    return [{**row, "elapsed_s": 0.0} for row in solution.history]


@pytest.fixture(scope="module")
def problem() -> Problem:
    truth = solve_room(Problem(scene(SUPPLY), ()), SETTINGS)
    # No further from the truth than its deviations allow, so that no other room is tried.
    entered = replace(SUPPLY, temperature_k=304.15, temperature_std_k=1.0, velocity_std_m_s=0.1)
    return measured(scene(entered), truth, 1e-5)


@pytest.fixture(scope="module")
def questions() -> Asked:
    return Asked(float("inf"))


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    return []


@pytest.fixture(scope="module")
def whole(problem: Problem, questions: Asked, rows: list[dict]) -> Solution:
    settings = replace(SETTINGS, threads=1)
    return solve_room(problem, settings, Watch(lambda row, growing: rows.append(dict(row)), questions))


def stopped(problem: Problem, store: dict, asked: Asked) -> list[str]:
    """What it said that it did until it was stopped."""
    told: list[str] = []
    watch = Watch(lambda row, growing: told.append(str(row["doing"])), asked, store)
    with pytest.raises(StoppedError):
        solve_room(problem, SETTINGS, watch)
    return told


def kept(store: dict) -> set[str]:
    """Kinds of what is kept: the end of a march, or one that was cut."""
    return {name.split("-")[0] for name in store} & {"march", "cut"}


def test_stopped_anywhere_it_goes_on_to_bitwise_the_same_end(
    problem: Problem, whole: Solution, questions: Asked
):
    cut, some = {"cut"}, {"march"}
    for n, doing, allowed in (
        # Before anything is kept.
        (0, "", [set()]),
        # In the first march, after a window of it.
        (4, "march the coarse room", [cut]),
        # While two threads march, whether or not either has a window to keep.
        (questions.count // 2, "move one parameter", [some, some | cut]),
        # At the last question.
        (questions.count - 1, "", [some, some | cut]),
    ):
        store: dict[str, bytes] = {}
        told = stopped(problem, store, Asked(n))
        assert ["", *told][-1].startswith(doing)
        assert kept(store) in allowed
        resumed = solve_room(problem, SETTINGS, Watch(store=store))
        same(resumed, whole)
        assert timeless(resumed) == timeless(whole)


def test_stopped_again_and_again_it_advances_each_time_and_ends_the_same(
    problem: Problem, whole: Solution, questions: Asked
):
    store: dict[str, bytes] = {}
    watch = None
    for attempt in itertools.count(1):
        asked = Asked(questions.count // 3)
        watch = Watch(should_stop=asked, store=store)
        try:
            found = solve_room(problem, replace(SETTINGS, threads=1), watch)
            break
        except StoppedError:
            assert attempt < 60
    assert attempt > 1
    same(found, whole)


def test_a_march_that_ended_is_never_marched_again(problem: Problem, whole: Solution):
    store: dict[str, bytes] = {}
    solve_room(problem, SETTINGS, Watch(store=store))
    ends = [name for name in store if name.startswith("march-")]
    assert len(ends) > 5
    assert not [name for name in store if name.startswith("cut-")]

    # One question a march, and none for chunks.
    asked = Asked(float("inf"))
    same(solve_room(problem, SETTINGS, Watch(should_stop=asked, store=store)), whole)
    assert asked.count == len(ends)


def test_a_stop_is_heard_at_the_next_chunk(problem: Problem, whole: Solution, rows: list[dict]):
    asked = Asked(20)
    stopped(problem, {}, asked)
    # Each march that is under way, or begins before all are called off, hears it at its next question and ends.
    together = 1 + max(row["of"] for row in rows if "of" in row)
    assert asked.count - 20 <= together


def test_what_is_kept_of_other_images_or_settings_is_refused(problem: Problem):
    store: dict[str, bytes] = {}
    stopped(problem, store, Asked(3))
    shift = problem.shifts[0]
    other = replace(problem, shifts=(replace(shift, displacement_px=2.0 * shift.displacement_px),))
    with pytest.raises(ForeignCheckpointError, match="were changed"):
        solve_room(other, SETTINGS, Watch(store=store))
    with pytest.raises(ForeignCheckpointError, match="were changed"):
        solve_room(problem, replace(SETTINGS, rounds=3), Watch(store=store))
    # How many threads march is no matter.
    stopped(problem, store, Asked(3))
    with pytest.raises(StoppedError):
        solve_room(problem, replace(SETTINGS, threads=1), Watch(should_stop=Asked(0), store=store))


def test_it_tells_what_it_does_how_much_is_done_and_which_parameters_it_has(
    whole: Solution, rows: list[dict]
):
    assert all(row["doing"] for row in rows)
    shares = [row["share"] for row in rows]
    assert shares == sorted(shares)
    assert 0 < shares[0] < 0.2
    assert 0.5 < shares[-1] < 1
    rounds = [row for row in whole.history if "round" in row]
    assert rounds
    for row in rounds:
        assert row["misfit_left"] > 0
        assert row["elapsed_s"] > 0
        # Entered 1 K too warm: the fit goes down from 11 K above ambient.
        assert row["supply 1: temperature above ambient (K)"] < 11.0
        # Known to a quarter.
        assert 0.6 < row["supply 1: velocity ratio"] < 1.4
    assert 0.0 < whole.history[-1]["supply_1_m_s"] < 0.5


def test_whoever_watches_sees_the_air_grow(problem: Problem):
    grown: list[Solution] = []

    def look(row, growing) -> None:
        if growing is not None and len(grown) < 2:
            grown.append(growing())

    stopped_at = Watch(look, lambda: len(grown) == 2)
    with pytest.raises(StoppedError):
        solve_room(problem, SETTINGS, stopped_at)
    assert grown[1].temperature_k.shape == (9, 9, 9)
    assert not np.array_equal(grown[0].temperature_k, grown[1].temperature_k)
    assert 290.0 < grown[1].temperature_k.mean() < 306.0
