"""How sheets are written: the PDF whole, then the record of it in the experiment."""

import importlib.metadata
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.experiment.folder import Experiment
from app.experiment.printed import Printed, record_name
from app.files.durable import durable_path, write_json
from app.files.provenance import sha256
from app.files.toml import to_plain
from app.sheets.drawing import Sheets


def version() -> str:
    """This program's version, as the footer tells it."""
    return importlib.metadata.version("airlens")


def write_sheets(path: Path, title: str, draw: Callable[[Sheets], object]) -> str:
    """Draw a PDF durably; returns its hash."""
    with durable_path(path) as temporary:
        sheets = Sheets(temporary, title)
        draw(sheets)
        sheets.save()
    return sha256(path)


def keep_record(experiment: Experiment, path: Path, digest: str, **told: Any) -> Printed:
    """Write down in the experiment what was printed."""
    inside = path.resolve().is_relative_to(experiment.folder.resolve())
    printed = Printed(
        file=str(path.resolve().relative_to(experiment.folder.resolve())) if inside else path.name,
        sha256=digest,
        version=version(),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        **told,
    )
    write_json(experiment.folder / record_name(printed.what, printed.view), to_plain(printed))
    return printed
