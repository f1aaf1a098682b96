"""Jobs: what is computed, in which order, how far it is, and what may be asked of it."""

from collections.abc import Callable
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from app.api.models.jobs import Curves, JobChange, JobResource, NewJob, State
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.api.wire.volumes import pack
from app.experiment.plan import PlacesLine
from app.files.npz import read_npy
from app.jobs import Job, JobSpec, JobState, explained, kinds
from app.jobs.attempt import PLANE_FILE
from app.jobs.folder import JobFolder
from app.jobs.kinds.places import read_places

router = APIRouter(tags=["jobs"])
NUMBERS = body("application/octet-stream", "Little-endian float32 in C order, along x then z.")


@router.get("/job-kinds")
def list_kinds() -> list[str]:
    """List what a job can compute."""
    return kinds.names()


@router.get("/jobs")
def list_jobs(
    given: Given,
    state: Annotated[State | None, Query()] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> list[JobResource]:
    """List jobs: the running first, then the waiting in their order, then the ended, newest first."""
    states = None if state is None else [JobState(state)]
    return [_resource(job) for job in explained(given.ledger, given.ledger.jobs(states=states, limit=limit))]


@router.post("/jobs", status_code=201)
def submit_job(given: Given, new: NewJob) -> JobResource:
    """Queue a job; once this is answered, the job survives a power cut."""
    spec = JobSpec(
        kind=new.kind,
        settings=new.settings,
        experiment=None if new.experiment is None else given.folders.folder(new.experiment),
        title=new.title,
        priority=new.priority,
    )
    return resource(given, given.ledger.submit(spec, key=new.key, group=new.group))


@router.get("/jobs/{job}")
def read_job(given: Given, job: Identifier) -> JobResource:
    """Return one job."""
    return resource(given, given.ledger.get(job))


@router.patch("/jobs/{job}")
def change_job(given: Given, job: Identifier, change: JobChange) -> JobResource:
    """Change where a waiting job stands in the queue."""
    if change.priority is not None:
        given.ledger.set_priority(job, change.priority)
    if change.before is not None or change.priority is None:
        given.ledger.move_before(job, change.before)
    return resource(given, given.ledger.get(job))


@router.post("/jobs/{job}/{action}")
def act_on_job(
    given: Given, job: Identifier, action: Literal["cancel", "pause", "resume", "retry"]
) -> JobResource:
    """Cancel (keeps the checkpoint), pause, resume, or retry (goes on from the checkpoint)."""
    return resource(given, _action(given, action)(job))


@router.get("/jobs/{job}/curves")
def read_curves(
    given: Given, job: Identifier, points: Annotated[int, Query(ge=2, le=100_000)] = 2000
) -> Curves:
    """Return the values that the job told at each step, thinned evenly to about `points`."""
    given.ledger.get(job)
    step, values = given.curves.read(job, points)
    return Curves(step=step, values=values)


@router.get("/jobs/{job}/field", response_class=Response, responses=NUMBERS)
def read_field(given: Given, job: Identifier) -> Response:
    """Return the room's middle plane, T - T0 [K] over x and z, as last shown; 204 while there is none."""
    found = given.ledger.get(job)
    path = JobFolder(given.ledger.folder / found.id).attempt(found.attempt) / PLANE_FILE
    try:
        plane = read_npy(path)
    except (FileNotFoundError, ValueError):
        return Response(status_code=204)
    packed = pack(plane, "f32")
    return Response(packed.content, media_type="application/octet-stream", headers=packed.headers)


@router.get("/jobs/{job}/places")
def read_places_found(given: Given, job: Identifier) -> PlacesLine:
    """Return what a finished job of kind `places` found: the signal from other places of the camera."""
    found = given.ledger.get(job)
    if found.kind != "places" or found.state is not JobState.done:
        raise ApiError(
            "not_found",
            f"Job {job} has found no places.",
            "Submit a job of kind places and wait until it is done.",
        )
    return read_places(JobFolder(given.ledger.folder / found.id).target())


def resource(given: Services, job: Job) -> JobResource:
    """Return what the API shows of a job, with why it waits."""
    return _resource(explained(given.ledger, [job])[0])


def _resource(job: Job) -> JobResource:
    return JobResource(
        job=job.id,
        number=job.number,
        kind=job.kind,
        settings=dict(job.settings),
        experiment=None if job.experiment is None else job.experiment.name,
        title=job.title,
        group=job.group,
        state=job.state.value,
        priority=job.priority,
        attempt=job.attempt,
        losses=job.losses,
        device=job.device,
        step=job.step,
        steps=job.steps,
        progress=job.progress,
        reason=job.reason,
        submitted_s=job.submitted_s,
        started_s=job.started_s,
        finished_s=job.finished_s,
    )


def _action(given: Services, action: str) -> Callable[[str], Job]:
    ledger = given.ledger
    return {"cancel": ledger.cancel, "pause": ledger.pause, "resume": ledger.resume, "retry": ledger.retry}[
        action
    ]
