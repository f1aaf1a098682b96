"""Results: what came out, as numbers for the page and as files for other programs."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse
from pydantic_core import from_json

from app.api.folders import shown_name
from app.api.models.results import (
    ComparisonResource,
    FieldResource,
    Form,
    FoundResource,
    PresetResource,
    ReadingResource,
    ResultLine,
    ResultResource,
    ScoreResource,
)
from app.api.security.headers import REPORT_POLICY
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.api.wire.volumes import (
    Axis,
    Encoding,
    Packed,
    Shown,
    Volume,
    burst_volume,
    cut,
    moving_volumes,
    pack,
)
from app.errors import BadInputError
from app.experiment.folder import Experiment, read_manifest
from app.experiment.found import Found, found_in
from app.files.reading import reading
from app.report.doubts import doubts
from app.setup.readback import answer_of

router = APIRouter(tags=["results"])
NUMBERS = body(
    "application/octet-stream",
    "Little-endian numbers in C order; value = X-Offset + X-Scale * number. X-Missing stands for no air.",
)
FILE = body("application/octet-stream", "A file to keep.")
PAGE = body("text/html", "A page in one file.", text=True)
Code = Annotated[Encoding, Query(description="u16: scaled; f16: about the middle; f32: as it is.")]


@router.get("/experiments/{experiment}/results")
def list_results(given: Given, experiment: Identifier) -> list[ResultLine]:
    """List the results, newest first; interrupted ones last."""
    done, broken = given.folders.items(experiment, "result")
    lines = [_line(path) for path in done]
    unfinished = [
        ResultLine(result=shown_name(path), state="interrupted", created=None, preset=None, outcome=None)
        for path in broken
    ]
    return lines + unfinished


@router.get("/experiments/{experiment}/results/{result}")
def read_result(given: Given, experiment: Identifier, result: Identifier) -> ResultResource:
    """Return one result without its numbers."""
    folder, shown = _shown(given, experiment, result)
    solution, manifest, of = shown.solution, read_manifest(folder), given.folders.open(experiment)
    return ResultResource(
        result=result,
        x_m=solution.x_m.tolist(),
        y_m=solution.y_m.tolist(),
        z_m=solution.z_m.tolist(),
        time_s=[] if solution.departures is None else solution.departures.time_s.tolist(),
        fields=[_field(volume) for volume in [*shown.volumes.values(), *moving_volumes(solution)]],
        outcome=solution.outcome.name,
        advice=solution.outcome.value,
        solver_s=solution.solver_s,
        notes=list(solution.notes),
        doubts=list(doubts(manifest.get("assumed", ()))),
        found=[_found(one, of) for one in found_in(manifest)],
        manifest=manifest,
    )


@router.get(
    "/experiments/{experiment}/results/{result}/volumes/{field}", response_class=Response, responses=NUMBERS
)
def read_volume(
    given: Given, experiment: Identifier, result: Identifier, field: Identifier, encoding: Code = "u16"
) -> Response:
    """Return a whole field, index order [ix, iy, iz]."""
    _, shown = _shown(given, experiment, result)
    return _numbers(pack(_volume(shown, field).values, encoding))


@router.get(
    "/experiments/{experiment}/results/{result}/slices/{field}", response_class=Response, responses=NUMBERS
)
def read_slice(
    given: Given,
    experiment: Identifier,
    result: Identifier,
    field: Identifier,
    axis: Axis = "y",
    index: Annotated[int, Query(ge=0, le=100_000)] = 0,
    encoding: Code = "f32",
) -> Response:
    """Return the plane of vertices at `index` along `axis`; the two other axes in the order x, y, z."""
    _, shown = _shown(given, experiment, result)
    return _numbers(pack(cut(_volume(shown, field).values, axis, index), encoding))


@router.get("/experiments/{experiment}/results/{result}/history")
def read_history(given: Given, experiment: Identifier, result: Identifier) -> list[dict[str, float | None]]:
    """Return the numbers that were recorded while it was solved, one object a recorded iteration."""
    path = given.folders.item(experiment, "result", result) / "history.jsonl"
    if not path.is_file():
        return []
    with reading(path, "Reconstruct again."):
        return [_finite(from_json(line)) for line in path.read_bytes().splitlines() if line.strip()]


@router.get("/experiments/{experiment}/results/{result}/comparison")
def read_comparison(given: Given, experiment: Identifier, result: Identifier) -> ComparisonResource:
    """Return how a result compares with what is known better: a simulated room's truth, point sensors."""
    _, shown = _shown(given, experiment, result)
    # Imported here: the array library behind them takes a second to load, which reading the result has done.
    from app.volume.comparison import readings, scores

    found = given.folders.open(experiment)
    truth = found.truth
    return ComparisonResource(
        scores=[] if truth is None else _score_lines(scores(shown.solution, truth)),
        readings=[
            ReadingResource(
                name=one.name,
                unit=one.unit,
                position_m=list(one.position_m),
                measured=one.measured,
                std=one.std,
                found=one.found,
            )
            for one in readings(found, shown.solution)
        ],
    )


@router.get("/experiments/{experiment}/results/{result}/report", response_class=Response, responses=PAGE)
def read_report(given: Given, experiment: Identifier, result: Identifier) -> Response:
    """Return the one-file report; it is shown without scripts and may reach nothing."""
    path = given.folders.item(experiment, "result", result) / "report.html"
    if not path.is_file():
        raise ApiError("not_found", "This result has no report yet.", "Make one: airlens report.")
    headers = {"content-security-policy": REPORT_POLICY}
    return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)


@router.get(
    "/experiments/{experiment}/results/{result}/exports/{form}", response_class=Response, responses=FILE
)
def read_export(given: Given, experiment: Identifier, result: Identifier, form: Form) -> Response:
    """Return the result as a file: NetCDF, HDF5, VTK image data, CSV, an OpenFOAM case (zip), a picture."""
    # Imported here: the writers take a second to load.
    from app.report.export import export

    folder = given.folders.item(experiment, "result", result)
    path = export(given.folders.folder(experiment), form, result=folder)
    return FileResponse(
        path,
        media_type="application/octet-stream",
        filename=f"{experiment}-{result}{_ENDINGS.get(form, '.' + form)}",
    )


# A collection is several files, packed.
_ENDINGS = {"pvd": "-bursts.zip"}


@router.get("/presets")
def list_presets() -> list[PresetResource]:
    """List the ways to solve: what serves where nobody chooses, then the quickest first."""
    from app.reconstruct.names import AUTO
    from app.reconstruct.presets import PRESETS, resolved

    ways = {AUTO: resolved, **PRESETS}
    return [PresetResource(preset=name, about=_first_line(way)) for name, way in ways.items()]


def _score_lines(scored: dict[str, Any]) -> list[ScoreResource]:
    """The figures that README and the report tell; left out where a quantity was not solved for."""
    temperature, velocity, pressure = scored["T"], scored["u"], scored["p"]
    lines = [
        ("T: rms error", temperature["rms_K"], "K"),
        ("T: rms error of the air, without walls' surfaces", temperature["air"]["rms_K"], "K"),
        ("T: rms error of the still air everywhere, for comparison", temperature["trivial"]["ambient"], "K"),
        (
            "T: rms error over the rms departure from each height's mean (1: as good as these means)",
            temperature["rel_departure"],
            "1",
        ),
    ]
    if velocity is not None:
        lines.append(("velocity: rms error over the rms of velocity", velocity["rel"], "1"))
        lines.append(("velocity: the same in the jet", velocity["jet_rel"], "1"))
    if pressure is not None:
        lines.append(("p: rms error over the rms of p", pressure["rel"], "1"))
    return [ScoreResource(name=n, value=v, unit=u) for n, v, u in lines if v is not None]


def _first_line(solve: object) -> str:
    return (solve.__doc__ or "").strip().split("\n")[0].split(" Raises ")[0]


def _shown(given: Services, experiment: str, result: str) -> tuple[Path, Shown]:
    folder = given.folders.item(experiment, "result", result)
    truth = given.folders.open(experiment).truth
    return folder, given.solutions.read(folder / "result.nc", truth)


def _volume(shown: Shown, field: str) -> Volume:
    moving = burst_volume(shown.solution, field)
    if moving is not None:
        return moving
    if field not in shown.volumes:
        raise ApiError("not_found", f"This result has no field {field!r}; it has {', '.join(shown.volumes)}.")
    return shown.volumes[field]


def _line(folder: Path) -> ResultLine:
    try:
        manifest = read_manifest(folder)
    except BadInputError as error:
        return ResultLine(
            result=shown_name(folder),
            state="broken",
            created=None,
            preset=None,
            outcome=None,
            reason=str(error),
        )
    created, preset, outcome = (
        None if manifest.get(key) is None else str(manifest[key]) for key in ("created", "preset", "outcome")
    )
    return ResultLine(
        result=shown_name(folder), state="finished", created=created, preset=preset, outcome=outcome
    )


def _field(volume: Volume) -> FieldResource:
    values = volume.values
    # Walls are far colder or warmer than the air beside them.
    air = values[1:-1, 1:-1, 1:-1] if min(values.shape) > 4 else values
    low, high = np.nanpercentile(air if np.isfinite(air).any() else values, (1, 99))
    return FieldResource(
        name=volume.name,
        unit=volume.unit,
        label=volume.label,
        kind=volume.kind,
        minimum=float(np.nanmin(values)),
        maximum=float(np.nanmax(values)),
        low=float(low),
        high=float(high),
        mean=float(np.nanmean(values, dtype="float64")),
    )


def _found(one: Found, experiment: Experiment) -> FoundResource:
    return FoundResource(
        name=one.box.name,
        sentence=one.sentence,
        lower_m=list(one.box.lower_m),
        upper_m=list(one.box.upper_m),
        solved=one.solved,
        answer=answer_of(one.box, experiment.settings.scene.room.lower_m),
        entry=one.entry,
    )


def _numbers(packed: Packed) -> Response:
    return Response(packed.content, media_type="application/octet-stream", headers=packed.headers)


def _finite(entry: dict[str, Any]) -> dict[str, float | None]:
    return {
        key: float(value) if isinstance(value, int | float) and abs(value) < 1e308 else None
        for key, value in entry.items()
        if not isinstance(value, str)
    }
