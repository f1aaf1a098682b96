"""`airlens devices`: what is plugged in, and what each can do."""

import json
from dataclasses import asdict
from typing import Annotated, Any

import typer


def register(cli: typer.Typer) -> None:
    """Add `devices`."""
    cli.command()(devices)


def devices(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    full: Annotated[bool, typer.Option("--full", help="List sizes, rates and controls too.")] = False,
) -> None:
    """List cameras with their formats and controls, and serial ports."""
    from app.rig.ports import found_ports
    from drivers.aravis import list_aravis
    from drivers.v4l2 import list_devices

    cameras, vision = list_devices(), list_aravis()
    ports = [asdict(port) for port in found_ports()]
    if as_json:
        found: list[dict[str, Any]] = [asdict(camera) for camera in cameras]
        networked = [asdict(camera) for camera in vision]
        content = {"cameras": found, "vision_cameras": networked, "serial_ports": ports}
        typer.echo(json.dumps(content, default=str))
        return
    for camera in cameras:
        typer.echo(f"{camera.path}  {camera.name}" + (f"  {camera.error}" if camera.error else ""))
        for item in camera.formats:
            sizes = [f"{s.width_px}x{s.height_px}@{max(s.rates_hz, default=0):g}" for s in item.sizes]
            shown = ", ".join(sizes if full else sizes[-3:])
            typer.echo(f"    {item.code:<5}{item.description:<24}{shown}")
        for control in camera.controls if full else ():
            typer.echo(f"    {control.name} {control.minimum}..{control.maximum} ({control.kind})")
    for one in vision:
        typer.echo(f"{one.device}  {one.name}  {one.address}  {one.error}".rstrip())
        for name in one.formats:
            typer.echo(f"    {name:<8}{one.width_px}x{one.height_px}")
    if not cameras and not vision:
        typer.echo(
            "No camera was found. Plug one in; on Linux it is /dev/video*, one of GigE or USB3 Vision needs "
            "libaravis-0.8-0. A simulated rig needs none: airlens demo."
        )
    for port in ports:
        typer.echo(f"{port['device']}  serial port  {port['description']}")
