"""`airlens serve`: the operator's page and the API on one address of this machine."""

import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.errors import BadInputError

if TYPE_CHECKING:
    from app.api.server import Tls


def register(cli: typer.Typer) -> None:
    """Add the command."""
    cli.command("serve")(serve)


def serve(
    data: Annotated[Path, typer.Argument(help="Folder that holds the experiments.")] = Path("airlens-data"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 finds a free port.")] = 8765,
    host: Annotated[
        str, typer.Option(help="Address to listen on; others than loopback need --expose.")
    ] = "127.0.0.1",
    expose: Annotated[
        bool, typer.Option("--expose", help="Listen on an address that other machines reach.")
    ] = False,
    tls_certificate: Annotated[Path | None, typer.Option(exists=True, dir_okay=False)] = None,
    tls_key: Annotated[Path | None, typer.Option(exists=True, dir_okay=False)] = None,
    public_url: Annotated[str | None, typer.Option(help="https address of a proxy in front.")] = None,
    renew_token: Annotated[
        bool, typer.Option("--new-token", help="Shut out everyone who has the old one.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the address as JSON.")] = False,
) -> None:
    """Serve the operator's page and the API; prints the address with its token."""
    from app.files.lock import alone

    tls = _tls(tls_certificate, tls_key)
    _check_exposure(host, expose, tls, public_url)
    root = data.resolve()
    with alone(root / "service" / "lock", "service"):
        _serve(root, port, host, renew_token, tls, public_url, as_json)


def _serve(
    root: Path,
    port: int,
    host: str,
    renew_token: bool,
    tls: "Tls | None",
    public_url: str | None,
    as_json: bool,
) -> None:
    from app.api.factory import create_app
    from app.api.security.settings import service_config
    from app.api.security.token import service_token
    from app.api.server import listen, server_of
    from app.files.durable import sweep
    from app.jobs import attended

    for left in sweep(root / "experiments"):
        logging.getLogger("airlens").warning("removed what a killed writer left: %s", left)
    token = service_token(root, renew_token)
    bound = listen(host, port)
    port = bound.getsockname()[1]
    config = service_config(root, token, port, host, public_url, tls is not None)
    server = server_of(create_app(config), tls)
    base = public_url or f"{'https' if tls else 'http'}://{f'[{host}]' if ':' in host else host}:{port}"
    address = f"{base.rstrip('/')}/#token={token}"
    typer.echo(json.dumps({"address": address, "port": port, "data": str(root)}) if as_json else address)
    logging.getLogger("airlens").setLevel(logging.INFO)
    with attended(config.jobs_folder):
        server.run(sockets=[bound])


def _tls(certificate: Path | None, key: Path | None) -> "Tls | None":
    from app.api.server import Tls

    if (certificate is None) != (key is None):
        raise BadInputError("Only one of --tls-certificate and --tls-key was given; give both or none.")
    return Tls(str(certificate), str(key)) if certificate and key else None


def _check_exposure(host: str, expose: bool, tls: "Tls | None", public_url: str | None) -> None:
    from app.api.security.settings import LOOPBACK

    if public_url is not None and not public_url.startswith("https://"):
        raise BadInputError(f"--public-url is {public_url!r}; expected an https:// address of a proxy.")
    if host in LOOPBACK:
        return
    if not expose:
        raise BadInputError(
            f"{host} can be reached by other machines. Add --expose if that is meant, with --tls-certificate "
            "and --tls-key or --public-url; or leave --host out."
        )
    if tls is None and public_url is None:
        raise BadInputError(
            "Without TLS the token would cross the network in clear. Give --tls-certificate and --tls-key, "
            "or --public-url with a proxy that speaks TLS."
        )
