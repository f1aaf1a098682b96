"""Jobs that belong together: the points of a sweep, the members of an ensemble; one summary."""

import contextlib
import itertools
import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.errors import AirlensError, BadInputError
from app.files.durable import write_json
from app.jobs import kinds
from app.jobs.folder import JobFolder
from app.jobs.ledger import Ledger
from app.jobs.records import Group, Job, JobSpec
from app.jobs.state import JobState

MOST_JOBS = 10_000


@dataclass(frozen=True, kw_only=True)
class Spread:
    """How a number varies over jobs. `std` is that of a sample; 0 for a single value."""

    count: int
    mean: float
    std: float
    least: float
    most: float


@dataclass(frozen=True, kw_only=True)
class Combination:
    """One job of a study: the settings that vary, and the numbers in its result (none while it has none)."""

    job: str
    state: JobState
    settings: Mapping[str, Any]
    numbers: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Summary:
    """All jobs of a group, in their order, and the spread of every number over those that are done."""

    group: Group
    states: Mapping[str, int]
    points: tuple[Combination, ...]
    spread: Mapping[str, Spread]


def submit_sweep(
    ledger: Ledger, spec: JobSpec, axes: Mapping[str, Sequence[Any]], title: str = ""
) -> tuple[Group, list[Job]]:
    """Queue one job for every combination of values, the last axis fastest; all or none.

    Raises BadInputError for an axis without values, too many jobs, or a value that the kind refuses.
    """
    count = math.prod(len(values) for values in axes.values())
    if not axes or not 1 <= count <= MOST_JOBS:
        raise BadInputError(
            f"This sweep has {count if axes else 0} jobs; 1 to {MOST_JOBS} are possible. "
            "Give each axis at least one value, as NAME=[1,2,3]."
        )
    chosen = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    return _submit(ledger, spec, chosen, title or f"{spec.kind} over {', '.join(axes)}")


def submit_ensemble(ledger: Ledger, spec: JobSpec, members: int, title: str = "") -> tuple[Group, list[Job]]:
    """Queue `members` jobs that differ only in their `seed`, counted up from the one that is set."""
    if not 1 <= members <= MOST_JOBS:
        raise BadInputError(f"This ensemble has {members} members; 1 to {MOST_JOBS} are possible.")
    kinds.check(spec.kind, spec.settings, spec.experiment)
    first = int(spec.settings.get("seed", 0))
    axes = {"seed": range(first, first + members)}
    return submit_sweep(ledger, spec, axes, title or f"{members} members of {spec.kind}")


def summarise(ledger: Ledger, group: str) -> Summary:
    """Return the summary of a group as it is now. Raises BadInputError when there is no such group."""
    known = {one.id: one for one in ledger.groups()}
    if group not in known:
        raise BadInputError(f"There is no group {group!r}. `airlens jobs groups` shows all of them.")
    jobs = sorted(ledger.jobs(group=group, limit=MOST_JOBS), key=lambda job: job.number)
    varying = _varying(jobs)
    points = tuple(_point(ledger, job, varying) for job in jobs)
    return Summary(
        group=known[group],
        states={state: sum(job.state is state for job in jobs) for state in {job.state for job in jobs}},
        points=points,
        spread=_spreads(points),
    )


def keep_summary(ledger: Ledger, group: str) -> None:
    """Write `groups/<id>.json` durably."""
    write_json(ledger.folder / "groups" / f"{group}.json", plain(summarise(ledger, group)))


def plain(summary: Summary) -> dict[str, Any]:
    """Return a summary as JSON values."""
    return {
        "group": vars(summary.group),
        "states": dict(summary.states),
        "points": [vars(point) for point in summary.points],
        "spread": {name: vars(spread) for name, spread in summary.spread.items()},
    }


def _submit(
    ledger: Ledger, spec: JobSpec, chosen: Sequence[Mapping[str, Any]], title: str
) -> tuple[Group, list[Job]]:
    specs = [replace(spec, settings={**spec.settings, **values}, title=_name(values)) for values in chosen]
    for one in specs:
        kinds.check(one.kind, one.settings, one.experiment)
    group = ledger.create_group(title)
    return group, ledger.submit_many(specs, group=group.id)


def _name(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in values.items())


def _varying(jobs: Sequence[Job]) -> list[str]:
    """Return the names of the settings that are not the same in all jobs."""
    names = dict.fromkeys(name for job in jobs for name in job.settings)
    return [n for n in names if len({json.dumps(job.settings.get(n)) for job in jobs}) > 1]


def _point(ledger: Ledger, job: Job, varying: Sequence[str]) -> Combination:
    numbers: dict[str, float] = {}
    if job.state is JobState.done:
        # A result that was deleted or damaged since has no numbers; the others have theirs.
        with contextlib.suppress(OSError, AirlensError, ValueError, KeyError, AttributeError, OverflowError):
            path = JobFolder(ledger.folder / job.id).target() / "result.json"
            found = json.loads(path.read_text(encoding="utf-8"))["summary"]
            numbers = {n: float(v) for n, v in found.items() if isinstance(v, int | float)}
    settings = {name: job.settings.get(name) for name in varying}
    return Combination(job=job.id, state=job.state, settings=settings, numbers=numbers)


def _spreads(points: Sequence[Combination]) -> dict[str, Spread]:
    names = dict.fromkeys(name for point in points for name in point.numbers)
    return {n: _spread([point.numbers[n] for point in points if n in point.numbers]) for n in names}


def _spread(values: Sequence[float]) -> Spread:
    return Spread(
        count=len(values),
        mean=statistics.fmean(values),
        std=statistics.stdev(values) if len(values) > 1 else 0.0,
        least=min(values),
        most=max(values),
    )
