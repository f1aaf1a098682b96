"""`airlens remote`: everything that the page and the client can ask of a running service, from a shell."""

import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from app.errors import BadInputError


def register(cli: typer.Typer) -> None:
    """Add the command."""
    cli.command("remote")(remote)


def remote(
    request: Annotated[str | None, typer.Argument(help="What to ask, such as jobs or start_capture.")] = None,
    values: Annotated[
        list[str] | None, typer.Argument(help="Arguments as NAME=VALUE (JSON or text).")
    ] = None,
    address: Annotated[
        str, typer.Option(envvar="AIRLENS_ADDRESS", help="What `airlens serve` printed.", show_default=False)
    ] = "",
) -> None:
    """Ask a running service; without a request, list what can be asked. Prints JSON."""
    from app.client import Client

    known = requests()
    if request is None:
        for name, method in known.items():
            typer.echo(
                f"{name}{inspect.signature(method).replace(return_annotation=inspect.Signature.empty)}"
            )
        return
    if request not in known:
        raise BadInputError(f"{request!r} cannot be asked; `airlens remote` lists what can.")
    if not address:
        raise BadInputError("No --address; give what `airlens serve` printed, or set AIRLENS_ADDRESS to it.")
    with Client(address) as client:
        for answer in _answers(getattr(client, request)(**_arguments(values or []))):
            typer.echo(json.dumps(_plain(answer)))


def requests() -> dict[str, Any]:
    """Return the client's requests by name."""
    from app.client import Client

    return {
        name: method
        for name, method in inspect.getmembers(Client, inspect.isfunction)
        if not name.startswith("_") and name != "close"
    }


def _arguments(values: list[str]) -> dict[str, Any]:
    pairs = [value.partition("=") for value in values]
    wrong = [name for name, equals, _ in pairs if not equals]
    if wrong:
        raise BadInputError(f"{wrong[0]!r} has no value; write NAME=VALUE.")
    return {name: _value(name, text) for name, _, text in pairs}


def _value(name: str, text: str) -> Any:
    if name == "file":
        return Path(text)
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def _answers(answer: Any) -> Iterator[Any]:
    if isinstance(answer, Iterator):
        yield from answer
    else:
        yield answer


def _plain(answer: Any) -> Any:
    from pydantic import BaseModel, TypeAdapter

    if isinstance(answer, BaseModel):
        return answer.model_dump()
    if isinstance(answer, bytes):
        return {"bytes": len(answer)}
    if hasattr(answer, "tolist"):
        return answer.tolist()
    return TypeAdapter(Any).dump_python(answer, mode="json")
