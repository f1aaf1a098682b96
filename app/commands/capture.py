"""`airlens capture`: reference and flow bursts, dark and flat frames, and a watch on the shift."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress as Bar

from app.errors import AirlensError
from drivers.burst import CaptureKind

Folder = Annotated[Path, typer.Argument(help="Experiment folder, whose rig names the camera.")]
_KINDS: dict[CaptureKind, str] = {
    "reference": "Take the reference: still air.",
    "flow": "Take the flow image, or a sequence of them.",
    "dark": "Take dark frames: lens covered.",
    "flat": "Take flat frames: an even, bright wall.",
}
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def register(cli: typer.Typer) -> None:
    """Add `capture` with one command for each kind of burst."""
    group = typer.Typer(no_args_is_help=True, help="Take bursts with the rig, or watch the shift live.")
    for kind, text in _KINDS.items():
        group.command(kind, help=text)(_command(kind))
    group.command()(watch)
    cli.add_typer(group, name="capture")


def _command(kind: CaptureKind):
    def command(
        experiment: Folder,
        frames: Annotated[int, typer.Option(min=1, help="Frames in the mean.")] = 100,
        exposure: Annotated[float | None, typer.Option(help="Exposure time in s.")] = None,
        gain: Annotated[float | None, typer.Option(help="Gain in the camera's own unit.")] = None,
        settle: Annotated[float, typer.Option(min=0.0, help="Wait so many seconds first.")] = 0.0,
        refresh_hz: Annotated[float | None, typer.Option(help="Projector's refresh rate in Hz.")] = None,
        rig_on: Annotated[float | None, typer.Option(help="How long the rig has been on, in s.")] = None,
        ambient_temperature_k: Annotated[
            float | None, typer.Option(min=150, max=400, help="Temperature of the room [K] (the scene's).")
        ] = None,
        raw: Annotated[bool, typer.Option("--raw", help="Keep every frame in frames.tif.")] = False,
        bursts: Annotated[int, typer.Option(min=1, help="Bursts in a sequence.")] = 1,
        every: Annotated[float, typer.Option(min=0.0, help="From start to start, in s.")] = 0.0,
        on_abort: Annotated[str, typer.Option(help="After Ctrl-C: keep or discard.")] = "keep",
        as_json: AsJson = False,
    ) -> None:
        from app.errors import BadInputError
        from app.rig.conditions import Conditions
        from drivers.burst import CapturePlan

        if on_abort not in ("keep", "discard"):
            raise BadInputError(f"--on-abort {on_abort!r} is not known; give keep or discard.")
        plan = CapturePlan(
            kind=kind,
            frames=frames,
            exposure_s=exposure,
            gain=gain,
            settle_s=settle,
            refresh_hz=refresh_hz,
            raw_stack=raw,
        )
        told = Conditions(ambient_temperature_k, None if rig_on is None else rig_on / 60)
        _take(experiment, plan, bursts, every, "keep" if on_abort == "keep" else "discard", told, as_json)

    return command


def _take(folder: Path, plan, bursts: int, every_s: float, on_abort, told, as_json: bool) -> None:
    from app.capture.burst import interruptible, take, take_sequence
    from app.experiment.folder import open_experiment
    from app.rig.open import open_camera
    from drivers.sequence import evenly

    experiment = open_experiment(folder)
    with (
        open_camera(experiment, "moving" if plan.kind == "flow" else "still") as camera,
        interruptible() as abort,
        Bar(transient=True) as bar,
    ):
        task = bar.add_task(f"{plan.kind} burst", total=plan.frames)

        def progress(now) -> None:
            bar.update(task, completed=now.done)

        if bursts == 1:
            options = {"abort": abort, "on_abort": on_abort, "told": told}
            taken = [take(camera, experiment, plan, progress, **options)]
        else:
            starts = evenly(bursts, every_s)
            options = {"abort": abort, "on_abort": on_abort, "told": told}
            taken = take_sequence(camera, experiment, plan, starts, progress, **options)
    for one in taken:
        typer.echo(json.dumps(_summary(one)) if as_json else _text(one))
    cut = [one for one in taken if one.burst.outcome != "complete"]
    if cut or len(taken) < bursts:
        raise AirlensError(
            f"The capture ended early ({cut[0].burst.outcome if cut else 'aborted'}); "
            "what was taken is as said above. Take it again."
        )


def _summary(one) -> dict[str, Any]:
    burst = one.burst
    return {
        "folder": str(one.folder) if one.folder else None,
        "outcome": burst.outcome,
        "frames": burst.frames,
        "refused": dict(burst.refused),
        "settings": {s.name: {"asked": s.asked, "granted": s.granted} for s in burst.settings},
        "verdicts": [{"name": v.name, "good": v.good, "value": v.value} for v in burst.verdicts],
    }


def _text(one) -> str:
    burst = one.burst
    refused = ", ".join(f"{count} {fault}" for fault, count in burst.refused.items()) or "none"
    lines = [f"{one.folder or 'discarded'}: {burst.outcome}, {burst.frames} frames, refused: {refused}"]
    lines += [
        f"  {v.name} {v.value:.3g}: expected {v.expected}. {v.advice}" for v in burst.verdicts if not v.good
    ]
    return "\n".join(lines)


def watch(
    experiment: Folder,
    count: Annotated[int, typer.Option(min=0, help="Looks; 0 goes on until Ctrl-C.")] = 0,
    every: Annotated[float, typer.Option(min=0.0, help="Pause between looks in s.")] = 0.5,
    as_json: AsJson = False,
) -> None:
    """Show the shift against the latest reference, live: drift of the border, and what moves inside."""
    import itertools
    import time

    import numpy as np

    from app.capture.burst import interruptible
    from app.experiment.captures import load_capture
    from app.experiment.folder import open_experiment
    from app.rig.open import open_camera
    from drivers.quick_look import quick_look

    opened = open_experiment(experiment)
    reference = load_capture(opened.latest_capture("reference"))
    with open_camera(opened, "moving") as camera, interruptible() as stopped:
        for number in itertools.count():
            if stopped() or (count and number >= count):
                return
            frame = camera.grab()
            image = (frame.pixels / np.float32(frame.full_scale_counts)).astype(np.float32)
            look = quick_look(reference.images[0].mean, image)
            (columns, rows), inner = look.drift_px, look.largest_px
            if as_json:
                typer.echo(
                    json.dumps({"drift_px": [columns, rows], "inner_px": inner, "sequence": frame.sequence})
                )
            else:
                typer.echo(f"drift {columns:+.3f}, {rows:+.3f} px; inside up to {inner:.3f} px")
            time.sleep(every)
