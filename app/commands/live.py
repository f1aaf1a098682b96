"""T of each burst on the error stream, while a command takes them."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import typer

from app.experiment.folder import Experiment

# The last burst's T is waited for at most so long.
_LAST_S = 60.0


@contextlib.contextmanager
def told_live(experiment: Experiment, wanted: bool) -> Iterator[Callable[[Path], object]]:
    """Yield what is to hear of each burst that is on the disk; the last one's T is waited for."""
    if not wanted:
        yield lambda folder: None
        return
    from app.live.beside import LiveAir, LivePlane

    ambient_k = experiment.settings.scene.air.ambient_temperature_k
    newest: list[str] = []
    shown: list[LivePlane | None] = [None]

    def tell(kind: str, body: Mapping[str, Any]) -> None:
        plane = beside.status.plane
        if body["reason"]:
            typer.echo(f"T of {body['capture'] or 'the bursts'}, {body['state']}: {body['reason']}", err=True)
        elif plane is not None and plane is not shown[0]:
            shown[0] = plane
            typer.echo(said(plane, ambient_k, body["skipped"]), err=True)

    def look(folder: Path) -> None:
        newest[:] = [folder.name]
        beside.look(experiment.folder, folder, "this series")

    beside = LiveAir(tell)
    beside.prepare(experiment.folder)
    try:
        yield look
        for name in newest:
            beside.wait(name, _LAST_S)
    finally:
        beside.close()


def said(plane: Any, ambient_k: float, skipped: int) -> str:
    """A plane in one line."""
    low, high = float(plane.kelvin.min()) - ambient_k, float(plane.kelvin.max()) - ambient_k
    passed = f"; {skipped} bursts passed over so far" if skipped else ""
    return (
        f"{plane.capture}: T in the middle of the room {low:+.2f} to {high:+.2f} K from ambient, noise "
        f"{plane.noise_k:.2g} K, {plane.took_s:.1f} s after the burst{passed}"
    )
