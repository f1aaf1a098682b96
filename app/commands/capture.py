"""`airlens capture`: reference and flow bursts, dark and flat frames, and a watch on the shift."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.progress import Progress as Bar

from app.errors import AirlensError

if TYPE_CHECKING:
    from drivers.burst import CaptureRole

Folder = Annotated[Path, typer.Argument(help="Experiment folder, whose rig names the camera.")]
OnAbort = Literal["keep", "discard"]
_ROLES: "dict[CaptureRole, str]" = {
    "reference": "Take the reference: still air.",
    "flow": "Take the flow image, or a sequence of them.",
    "dark": "Take dark frames: lens covered.",
    "flat": "Take flat frames: an even, bright wall.",
}
AtOnce = Annotated[
    bool, typer.Option("--at-once", help="Several cameras take theirs at the same time; else in turn.")
]
OfView = Annotated[
    str | None, typer.Option(help="Which camera, by its view's name, where there are several.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def register(cli: typer.Typer) -> None:
    """Add `capture` with one command for each role."""
    group = typer.Typer(no_args_is_help=True, help="Take bursts with the rig, or watch the shift live.")
    for role, text in _ROLES.items():
        group.command(role, help=text)(_command(role))
    group.command()(series)
    group.command("retake")(take_again)
    group.command()(watch)
    cli.add_typer(group, name="capture")


def _command(role: "CaptureRole"):
    def command(
        experiment: Folder,
        frames: Annotated[int, typer.Option(min=1, help="Frames in the mean.")] = 100,
        exposure_s: Annotated[float | None, typer.Option(help="Exposure time [s] of this capture.")] = None,
        gain: Annotated[
            float | None, typer.Option(help="Gain of this capture, in the camera's unit.")
        ] = None,
        settle_s: Annotated[float, typer.Option(min=0.0, help="Wait so long first [s].")] = 0.0,
        settle_frames: Annotated[
            int, typer.Option(min=0, help="Discard up to so many until two are equally bright.")
        ] = 30,
        max_refused: Annotated[int, typer.Option(min=0, help="Give up after so many bad frames.")] = 100,
        refresh_hz: Annotated[float | None, typer.Option(help="Projector's refresh rate [Hz].")] = None,
        raw_stack: Annotated[
            bool, typer.Option("--raw-stack", help="Keep every frame in frames.tif.")
        ] = False,
        bursts: Annotated[int, typer.Option(min=1, help="Bursts in a sequence.")] = 1,
        every_s: Annotated[float, typer.Option(min=0.0, help="From start to start of its bursts [s].")] = 0.0,
        ambient_temperature_k: Annotated[
            float | None, typer.Option(min=150, max=400, help="Temperature of the room [K] (the scene's).")
        ] = None,
        minutes_on: Annotated[
            float | None, typer.Option(min=0, help="Minutes that the rig has been on (the lamp's).")
        ] = None,
        at_once: AtOnce = False,
        live: Annotated[
            bool,
            typer.Option("--live", help="Tell T of each burst of a flow as it comes, on the error stream."),
        ] = False,
        on_abort: Annotated[OnAbort, typer.Option(help="After Ctrl-C: the frames so far.")] = "keep",
        as_json: AsJson = False,
    ) -> None:
        from app.capture.burst import Order
        from app.rig.conditions import Conditions
        from drivers.burst import CapturePlan

        plan = CapturePlan(
            role, frames, exposure_s, gain, settle_s, settle_frames, max_refused, refresh_hz, raw_stack
        )
        told = Conditions(ambient_temperature_k, minutes_on)
        _take(experiment, Order(plan, bursts, every_s, told, at_once, live), on_abort, as_json)

    return command


def _take(folder: Path, order, on_abort: OnAbort, as_json: bool) -> None:
    from app.capture.burst import interruptible, take_order
    from app.capture.watched import BurstWatch
    from app.commands.live import told_live
    from app.experiment.folder import open_experiment
    from app.rig.open import air_of, open_camera

    experiment, plan = open_experiment(folder), order.plan
    with (
        told_live(experiment, order.live and plan.role == "flow") as look,
        open_camera(experiment, air_of(plan.role)) as camera,
        interruptible() as stopped,
        Bar(transient=True) as bar,
    ):
        task = bar.add_task(f"{plan.role} burst", total=plan.frames)
        watch = BurstWatch(
            progress=lambda now: bar.update(task, completed=now.done),
            stop=lambda: on_abort if stopped() else None,
            kept=look,
        )
        taken = take_order(camera, experiment, order, watch)
    for one in taken:
        typer.echo(json.dumps(_summary(one)) if as_json else said(one))
    if not taken or taken[-1].shortfall:
        raise AirlensError(taken[-1].shortfall if taken else "Stopped before the first burst.")
    if len(taken) < order.bursts:
        raise AirlensError(f"Stopped after {len(taken)} of {order.bursts} bursts; they are kept.")


def _summary(one) -> dict[str, Any]:
    burst = one.burst
    return {
        "folder": str(one.folder) if one.folder else None,
        "outcome": burst.outcome,
        "frames": burst.frames,
        "refused": dict(burst.refused),
        "settings": {s.name: {"asked": s.asked, "granted": s.granted} for s in burst.settings},
        "verdicts": [{"name": v.name, "good": v.good, "value": v.value} for v in burst.verdicts],
        "missing": dict(one.failed),
    }


def said(one) -> str:
    """A burst in words: where it is, and what is wrong with it."""
    burst = one.burst
    refused = ", ".join(f"{count} {fault}" for fault, count in burst.refused.items()) or "none"
    lines = [f"{one.folder or 'discarded'}: {burst.outcome}, {burst.frames} frames, refused: {refused}"]
    lines += [
        f"  {v.name} {v.value:.3g}: expected {v.expected}. {v.advice}" for v in burst.verdicts if not v.good
    ]
    return "\n".join(lines)


def take_again(
    experiment: Folder,
    view: Annotated[
        str | None, typer.Option(help="Which camera, by its view's name; the missing one, where one is.")
    ] = None,
    capture: Annotated[str | None, typer.Option(help="Which capture, by its folder; the newest.")] = None,
    as_json: AsJson = False,
) -> None:
    """Take one camera's picture of a capture again, alone, as it was asked for; the other cameras' stay."""
    from app.capture.burst import interruptible
    from app.capture.retake import place_of, retake, to_retake
    from app.capture.watched import BurstWatch
    from app.experiment.folder import open_experiment
    from app.rig.open import air_of, open_camera

    opened = open_experiment(experiment)
    parts, number = to_retake(opened, capture, view)
    with (
        open_camera(opened, air_of(parts.plan.role), number, place_of(parts.origin)) as camera,
        interruptible() as stopped,
        Bar(transient=True) as bar,
    ):
        task = bar.add_task(parts.names[number], total=parts.plan.frames)
        watch = BurstWatch(
            progress=lambda now: bar.update(task, completed=now.done),
            stop=lambda: "keep" if stopped() else None,
        )
        taken = retake(camera, opened, parts, number, watch=watch)
    typer.echo(json.dumps(_summary(taken)) if as_json else said(taken))
    if taken.shortfall:
        raise AirlensError(taken.shortfall)


def series(
    experiment: Folder,
    frames: Annotated[int, typer.Option(min=1, help="Frames in each mean.")] = 100,
    exposure_s: Annotated[float | None, typer.Option(help="Exposure time [s] of all three.")] = None,
    before_flow_s: Annotated[float, typer.Option(min=0.0, help="Wait so long before the flow [s].")] = 0.0,
    before_reference_s: Annotated[
        float, typer.Option(min=0.0, help="Wait so long before the second reference [s].")
    ] = 0.0,
    ask: Annotated[
        bool, typer.Option("--ask/--no-ask", help="Wait for Enter before each burst, to change the air.")
    ] = True,
    at_once: AtOnce = False,
    as_json: AsJson = False,
) -> None:
    """Take reference, flow and reference again, and say how far the camera moved meanwhile."""
    from rich.progress import Progress as Bar

    from app.capture.burst import interruptible
    from app.capture.series import take_series
    from app.capture.watched import BurstWatch
    from app.experiment.folder import open_experiment
    from app.rig.open import air_of, open_camera
    from drivers.burst import CapturePlan

    opened, words = open_experiment(experiment), {"reference": "still air", "flow": "the air moving"}

    def ready(role: "CaptureRole", place: int) -> None:
        if ask:
            typer.prompt(
                f"{place + 1} of 3, {role}: {words[role]}. Enter when it is so",
                default="",
                show_default=False,
                err=True,
            )

    with interruptible() as stopped, Bar(transient=True, disable=ask) as bar:
        task = bar.add_task("series", total=frames)
        watch = BurstWatch(
            progress=lambda now: bar.update(task, completed=now.done),
            stop=lambda: "keep" if stopped() else None,
        )
        plan = CapturePlan("reference", frames, exposure_s)
        found = take_series(
            lambda role, place: open_camera(opened, air_of(role), moment=place),
            opened,
            plan,
            (before_flow_s, before_reference_s),
            watch=watch,
            ready=ready,
            at_once=at_once,
        )
    for one in found.taken:
        typer.echo(json.dumps(_summary(one)) if as_json else said(one))
    typer.echo(json.dumps({"agree": found.agree, "said": found.said}) if as_json else found.said)


def watch(
    experiment: Folder,
    count: Annotated[int, typer.Option(min=0, help="Looks; 0 goes on until Ctrl-C.")] = 0,
    every_s: Annotated[float, typer.Option(min=0.0, help="Pause between looks [s].")] = 0.5,
    view: OfView = None,
    as_json: AsJson = False,
) -> None:
    """Show the shift against the latest reference, live: drift of the border, and what moves inside."""
    import itertools
    import time

    import numpy as np

    from app.capture.burst import interruptible
    from app.experiment.captures import load_capture
    from app.experiment.folder import open_experiment
    from app.experiment.views import view_number
    from app.rig.open import open_camera
    from drivers.quick_look import quick_look

    opened = open_experiment(experiment)
    number_of_view = view_number(opened, view)
    reference = load_capture(opened.latest_capture("reference")).images[number_of_view].mean
    with open_camera(opened, "moving", number_of_view) as camera, interruptible() as stopped:
        for number in itertools.count():
            if stopped() or (count and number >= count):
                return
            frame = camera.grab()
            image = (frame.pixels / np.float32(frame.full_scale_counts)).astype(np.float32)
            look = quick_look(reference, image)
            (columns, rows), inner = look.drift_px, look.largest_px
            if as_json:
                typer.echo(
                    json.dumps({"drift_px": [columns, rows], "inner_px": inner, "sequence": frame.sequence})
                )
            else:
                typer.echo(f"drift {columns:+.3f}, {rows:+.3f} px; inside up to {inner:.3f} px")
            time.sleep(every_s)
