"""`airlens simulate`."""

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.progress import Progress

Size = Annotated[str, typer.Option(help="Camera size, WIDTHxHEIGHT or WIDTH (3:4).")]


def register(cli: typer.Typer) -> None:
    """Add `simulate`."""
    cli.command()(simulate)


def simulate(
    experiment: Annotated[Path, typer.Argument(help="New experiment folder.")],
    truth: Annotated[Path, typer.Option(help="Room volume (NPZ).")],
    snapshots: Annotated[
        Path | None,
        typer.Option(help="The air of that room at several moments (NPZ): each flow frame sees its own."),
    ] = None,
    views: Annotated[
        str,
        typer.Option(help="Walls that are patterned, a camera before each: y_max,x_max,z_max; y is y_max."),
    ] = "y",
    light: Annotated[
        Literal["texture", "projector"], typer.Option(help="What patterns the wall.")
    ] = "texture",
    information: Annotated[
        Literal["paper", "operator", "surveyed"], typer.Option(help="What is told of the boundary.")
    ] = "operator",
    camera_px: Size = "4096x3072",
    frames: Annotated[int, typer.Option(min=1, help="Frames averaged in each capture.")] = 100,
    frame_rate: Annotated[float, typer.Option(min=1e-3, max=10_000.0, help="Frames a second [1/s].")] = 30.0,
    full_well: Annotated[float, typer.Option(help="Full well of a pixel [e-].")] = 10_000.0,
    world: Annotated[
        Literal["ideal", "lab"],
        typer.Option(
            help="lab: blur, a lamp that ripples, things before the wall, misread entries, and so on; ideal: none."
        ),
    ] = "lab",
    nuisance: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="One nuisance of the world, such as blur_px=0.6; may be given several times."
        ),
    ] = None,
    drift_px: Annotated[
        float | None, typer.Option(min=0.0, help="Drift between exposures [px]: in a lab 0.3, ideal 0.1.")
    ] = None,
    border: Annotated[
        Literal["print", "bare", "room"] | None,
        typer.Option(
            help="Beyond the wall: nothing to see (lab), a still print (ideal), or the room's other walls."
        ),
    ] = None,
    marks: Annotated[
        bool,
        typer.Option("--marks", help="Two still boards near the camera, in the picture's upper corners."),
    ] = False,
    bracketed: Annotated[
        bool,
        typer.Option("--bracketed", help="A second reference after the flow, as capture series takes it."),
    ] = False,
    misread: Annotated[
        bool | None,
        typer.Option("--misread/--exact", help="Whether entries are as wrong as stated; in a lab they are."),
    ] = None,
    rig: Annotated[
        Literal["paper", "lab"] | None,
        typer.Option(
            help="Where the optics stand: a lab's 4 m, projector diagonal (in a lab); the paper's 30.5 m (ideal)."
        ),
    ] = None,
    stand_off: Annotated[
        float | None, typer.Option(help="Camera to back wall [m]; the rig's by default.")
    ] = None,
    baseline: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Projector minus camera, horizontal and vertical [m]; the rig's by default."),
    ] = None,
    further_projector: Annotated[
        list[str] | None,
        typer.Option(
            help="A further projector that lights the first wall in turn, for the same camera: minus camera, "
            "horizontal and vertical [m], such as -1,-1; may be given several times."
        ),
    ] = None,
    noise_free: Annotated[
        bool, typer.Option("--noise-free", help="No shot, read or rounding noise.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of pattern, noise and drift.")] = 0,
) -> None:
    """Make a complete experiment from a room volume: scene, calibration, reference and flow captures."""
    from app.simulate.experiment import simulate as run
    from app.simulate.worlds import WORLDS, changed
    from app.volume.scene import RIG_PLACES, RigOptions, parse_walls

    rig_stand_off_m, rig_baseline_m = RIG_PLACES[rig or WORLDS[world].place]
    options = RigOptions(
        camera_px=parse_size(camera_px),
        light=light,
        frames=frames,
        full_well_e=full_well,
        stand_off_m=rig_stand_off_m if stand_off is None else stand_off,
        baseline_m=rig_baseline_m if baseline is None else baseline,
        pattern_seed=seed,
        walls=parse_walls(views),
        marks=marks,
        further_projectors_m=tuple(parse_baseline(text) for text in further_projector or ()),
    )
    shown = changed(WORLDS[world], nuisance or [], drift_px, border, misread)
    camera = shown.camera(seed, noise_free).model_copy(update={"frame_rate_hz": frame_rate})
    with Progress(transient=True) as progress:
        tasks = {}

        def stage(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = progress.add_task(f"{name} capture", total=total)
            progress.update(tasks[name], completed=done)

        run(
            truth,
            experiment,
            options,
            information,
            camera,
            stage,
            misreads=shown.misreads,
            bracketed=bracketed,
            snapshots_path=snapshots,
        )
    typer.echo(
        f"{experiment}: reference and flow captured. Next: airlens reconstruct {shlex.quote(str(experiment))}"
    )


def parse_baseline(text: str) -> "tuple[float, float]":
    """'-1,-1' to metres. Raises BadInputError."""
    from app.errors import BadInputError

    try:
        across, up = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInputError(
            f"--further-projector is {text!r}; expected metres across and up from the camera, such as -1,-1."
        ) from None
    return across, up


def parse_size(text: str) -> tuple[int, int]:
    """'4096x3072' or '4096' (height three quarters) to (width, height). Raises BadInputError."""
    from app.errors import BadInputError

    parts = text.lower().split("x")
    if not all(p.isdigit() for p in parts) or len(parts) > 2:
        raise BadInputError(
            f"The camera size is {text!r}; expected WIDTHxHEIGHT in pixels, such as 4096x3072."
        )
    width = int(parts[0])
    return width, int(parts[1]) if len(parts) == 2 else width * 3 // 4
