"""`airlens projector`: power, source, mute, freeze; what it says, and every byte of it."""

import contextlib
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from app.rig.projectors import PASSWORD, open_real_projector

Url = Annotated[
    str,
    typer.Argument(help="DIALECT:/dev/ttyUSB0 or DIALECT://address; as escvp21, pjlink."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Wire = Annotated[bool, typer.Option("--wire", help="Show what goes over the line.")]


def register(cli: typer.Typer) -> None:
    """Add `projector` and its commands."""
    group = typer.Typer(
        no_args_is_help=True,
        help=f"Speak to a projector. A PJLink password is taken from the environment ({PASSWORD}).",
    )
    group.command()(status)
    for name in ("on", "off", "mute", "unmute", "freeze", "unfreeze"):
        group.command(name, help=_HELP[name])(_switch(name))
    group.command()(source)
    group.command()(check)
    cli.add_typer(group, name="projector")


_HELP = {
    "on": "Light the lamp and return; it warms up on its own.",
    "off": "Put the lamp out and return; it cools down on its own.",
    "mute": "Make the picture black.",
    "unmute": "Show the picture again.",
    "freeze": "Hold the picture.",
    "unfreeze": "Let the picture go.",
}


def status(url: Url, as_json: AsJson = False, wire: Wire = False) -> None:
    """Ask everything that the projector can tell."""
    with _opened(url, wire) as projector:
        found = projector.status()
        known = sorted(projector.capabilities)
    if as_json:
        typer.echo(json.dumps(asdict(found) | {"capabilities": known}))
        return
    typer.echo(f"{found.name or 'Projector'}: {found.power}")
    for name, value in asdict(found).items():
        if name not in ("name", "power") and value not in (None, ()):
            typer.echo(f"    {name.replace('_', ' ')}: {value}")


def source(
    url: Url, code: Annotated[str, typer.Argument(help="The input's code in the manual.")], wire: Wire = False
) -> None:
    """Show another input."""
    with _opened(url, wire) as projector:
        projector.select_source(code)
    typer.echo(f"source {code}")


def check(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder, whose scene has a projector.")],
    screen: Annotated[
        str, typer.Option(help="kiosk (a page, opened on the projector), or a card such as /dev/dri/card0.")
    ] = "kiosk",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the kiosk pages.")] = 8766,
    view: Annotated[str | None, typer.Option(help="Only the projector that lights this view.")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the pattern of each projector and let its camera say whether it sees what was sent."""
    from app.capture.pattern_check import check_projectors
    from app.errors import AirlensError
    from app.experiment.folder import open_experiment
    from drivers.verdict import Verdict

    opened, failed, good = open_experiment(experiment), [], True
    for name, found in check_projectors(opened, screen, port, lambda text: typer.echo(text, err=True), view):
        whose = f"{name}: " if name else ""
        if not isinstance(found, Verdict):
            failed.append(f"{whose}{found}")
            continue
        good &= found.good
        if as_json:
            typer.echo(json.dumps(asdict(found) | ({"view": name} if name else {})))
        else:
            advice = "" if found.good else f" {found.advice}"
            typer.echo(f"{whose}{found.name}: {found.value:.3f}; expected {found.expected}.{advice}")
    if failed:
        raise AirlensError(" ".join(failed))
    if not good:
        raise typer.Exit(1)


def _switch(name: str):
    def switch(url: Url, as_json: AsJson = False, wire: Wire = False) -> None:
        with _opened(url, wire) as projector:
            if name in ("on", "off"):
                projector.turn_on() if name == "on" else projector.turn_off()
            elif name in ("mute", "unmute"):
                projector.mute(name == "mute")
            else:
                projector.freeze(name == "freeze")
            power = projector.power()
        typer.echo(json.dumps({"done": name, "power": power}) if as_json else f"{name}: {power}")

    return switch


@contextlib.contextmanager
def _opened(url: str, wire: bool) -> Iterator:
    with open_real_projector(url) as projector:
        try:
            yield projector
        finally:
            for entry in projector.log.entries if wire else ():
                typer.echo(str(entry), err=True)
