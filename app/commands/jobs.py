"""`airlens jobs`: queue, watch, order, stop and go on with computations."""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from app.errors import BadInputError
from app.jobs import (
    Event,
    Group,
    Job,
    JobSpec,
    JobState,
    Ledger,
    explained,
    submit_ensemble,
    submit_sweep,
    summarise,
)
from app.jobs.__main__ import supervise
from app.jobs.study import plain as plain_summary

Folder = Annotated[
    Path, typer.Option("--folder", envvar="AIRLENS_JOBS", help="The folder of the ledger and its jobs.")
]
JobId = Annotated[str, typer.Argument(help="The job's id.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Kind = Annotated[str, typer.Argument(help="What to compute, such as reconstruct or noise-study.")]
Settings = Annotated[list[str] | None, typer.Argument(help="Settings as NAME=VALUE (JSON).")]
ExperimentFolder = Annotated[Path | None, typer.Option("--experiment", help="The experiment's folder.")]
Title = Annotated[str, typer.Option(help="A name for people.")]
HERE = Path("jobs")


def register(cli: typer.Typer) -> None:
    """Add `jobs` and its subcommands."""
    jobs = typer.Typer(no_args_is_help=True, help="Queue, watch, stop and resume computations.")
    for command in (run, submit, sweep, ensemble, groups, summary, show, events):
        jobs.command()(command)
    for command in (cancel, pause, resume, retry, order):
        jobs.command()(command)
    jobs.command("list")(list_jobs)
    cli.add_typer(jobs, name="jobs")


def run(folder: Folder = HERE) -> None:
    """Run the queue until interrupted; running jobs go on and are adopted by the next `run`."""
    supervise(folder)


def submit(
    kind: Kind,
    settings: Settings = None,
    experiment: ExperimentFolder = None,
    title: Title = "",
    priority: Annotated[int, typer.Option(help="Higher starts first.")] = 0,
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """Queue one job and print its id."""
    spec = JobSpec(
        kind=kind, settings=read_settings(settings), experiment=experiment, title=title, priority=priority
    )
    _print_job(Ledger(folder).submit(spec), as_json)


def sweep(
    kind: Kind,
    over: Annotated[list[str], typer.Option(help="NAME=[1,2,3]; several give every combination.")],
    settings: Settings = None,
    experiment: ExperimentFolder = None,
    title: Title = "",
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """Queue one job for every combination of values and print the group."""
    axes = read_settings(over)
    for name, values in axes.items():
        if not isinstance(values, list):
            raise BadInputError(f"--over {name} was given {values!r}; expected a list such as [1,2,3].")
    spec = JobSpec(kind=kind, settings=read_settings(settings), experiment=experiment)
    _print_group(*submit_sweep(Ledger(folder), spec, axes, title), as_json)


def ensemble(
    kind: Kind,
    settings: Settings = None,
    members: Annotated[int, typer.Option(min=1, help="Jobs that differ only in their seed.")] = 8,
    experiment: ExperimentFolder = None,
    title: Title = "",
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """Queue the members of an ensemble and print the group."""
    spec = JobSpec(kind=kind, settings=read_settings(settings), experiment=experiment)
    _print_group(*submit_ensemble(Ledger(folder), spec, members, title), as_json)


def groups(folder: Folder = HERE, as_json: AsJson = False) -> None:
    """List sweeps and ensembles, newest first."""
    found = Ledger(folder).groups()
    text = json.dumps([vars(g) for g in found]) if as_json else "\n".join(f"{g.id}  {g.title}" for g in found)
    typer.echo(text)


def summary(
    group: Annotated[str, typer.Argument(help="The group's id.")],
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """Summarise a sweep or an ensemble: every job's numbers, and their spread."""
    found = summarise(Ledger(folder), group)
    if as_json:
        typer.echo(json.dumps(plain_summary(found), indent=1))
        return
    table = Table(*(found.points[0].settings if found.points else ()), "state", *found.spread)
    for point in found.points:
        numbers = [f"{point.numbers[n]:.6g}" if n in point.numbers else "" for n in found.spread]
        table.add_row(*map(str, point.settings.values()), point.state, *numbers)
    Console().print(table)
    for name, spread in found.spread.items():
        typer.echo(f"{name}: {spread.mean:.6g} +- {spread.std:.2g} ({spread.least:.6g} to {spread.most:.6g})")


def list_jobs(
    state: Annotated[list[JobState] | None, typer.Option(help="Only jobs in this state.")] = None,
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """List jobs: the running ones, the waiting in their order, the ended."""
    ledger = Ledger(folder)
    found = explained(ledger, ledger.jobs(states=state or None))
    if as_json:
        typer.echo(json.dumps([plain(job) for job in found], indent=1))
        return
    if not found:
        typer.echo(
            "There are no jobs here. Queue one: airlens jobs submit reconstruct --experiment EXPERIMENT"
        )
        return
    table = Table("id", "title", "state", "progress", "attempt", "device", "reason")
    for job in found:
        share = f"{job.progress:.0%}"
        table.add_row(job.id, job.title, job.state, share, str(job.attempt), job.device or "", job.reason)
    Console().print(table)


def show(job: JobId, folder: Folder = HERE, as_json: AsJson = False) -> None:
    """Show one job, and why it waits."""
    ledger = Ledger(folder)
    _print_job(explained(ledger, [ledger.get(job)])[0], as_json)


def events(
    job: Annotated[str | None, typer.Argument(help="Only this job's events.")] = None,
    after: Annotated[int, typer.Option(help="Only events with a larger id.")] = 0,
    follow: Annotated[bool, typer.Option(help="Wait for more until interrupted.")] = False,
    folder: Folder = HERE,
) -> None:
    """Print events as JSON lines, oldest first."""
    ledger = Ledger(folder)
    while True:
        found = ledger.events(after=after, job=job)
        for event in found:
            typer.echo(json.dumps(_plain_event(event)))
            after = event.id
        if not found and not follow:
            return
        if not found:
            time.sleep(0.5)


def cancel(job: JobId, folder: Folder = HERE, as_json: AsJson = False) -> None:
    """Stop a job; its checkpoint is kept and `retry` goes on from it."""
    ledger = Ledger(folder)
    _print_job(explained(ledger, [ledger.cancel(job)])[0], as_json)


def pause(job: JobId, folder: Folder = HERE, as_json: AsJson = False) -> None:
    """Stop a job at a checkpoint until `resume`."""
    _print_job(Ledger(folder).pause(job), as_json)


def resume(job: JobId, folder: Folder = HERE, as_json: AsJson = False) -> None:
    """Queue a paused job again."""
    _print_job(Ledger(folder).resume(job), as_json)


def retry(job: JobId, folder: Folder = HERE, as_json: AsJson = False) -> None:
    """Queue a failed, cancelled or lost job again."""
    _print_job(Ledger(folder).retry(job), as_json)


def order(
    job: JobId,
    before: Annotated[str | None, typer.Option(help="Put it before this job.")] = None,
    priority: Annotated[int | None, typer.Option(help="Set its priority instead.")] = None,
    folder: Folder = HERE,
    as_json: AsJson = False,
) -> None:
    """Put a waiting job first, before another, or at another priority."""
    ledger = Ledger(folder)
    moved = ledger.move_before(job, before) if priority is None else ledger.set_priority(job, priority)
    _print_job(moved, as_json)


def read_settings(words: list[str] | None) -> dict[str, Any]:
    """Return NAME=VALUE words as settings; a value that is no JSON is taken as text."""
    settings: dict[str, Any] = {}
    for word in words or []:
        name, equals, text = word.partition("=")
        if not equals or not name:
            raise BadInputError(f"{word!r} is not NAME=VALUE. Write, for example, trials=200.")
        try:
            settings[name] = json.loads(text)
        except json.JSONDecodeError:
            settings[name] = text
    return settings


def plain(job: Job) -> dict[str, Any]:
    """Return a job as JSON values."""
    values = {name: getattr(job, name) for name in Job.__dataclass_fields__}
    experiment = str(job.experiment) if job.experiment else None
    return values | {"progress": job.progress, "experiment": experiment}


def _print_job(job: Job, as_json: bool) -> None:
    line = f"{job.id}  {job.title}  {job.state}  {job.progress:.0%}  {job.reason}".rstrip()
    typer.echo(json.dumps(plain(job)) if as_json else line)


def _print_group(group: Group, jobs: list[Job], as_json: bool) -> None:
    told = {"group": group.id, "title": group.title, "jobs": [job.id for job in jobs]}
    typer.echo(json.dumps(told) if as_json else f"{group.id}  {group.title}  {len(jobs)} jobs")


def _plain_event(event: Event) -> dict[str, Any]:
    return {name: getattr(event, name) for name in Event.__dataclass_fields__}
