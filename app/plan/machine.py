"""How fast this machine solves: two numbers a preset, measured once by `airlens bench calibrate`.

Kept in the user's cache folder, or where AIRLENS_MACHINE says. Without a
measurement the packaged figures of the machine that the README's were taken on serve, and the plan says so.
"""

import json
import os
from pathlib import Path

from app.errors import BadInputError
from app.files.durable import write_json
from app.files.toml import Strict, parse, to_plain
from app.files.user_folders import cache_folder
from core.plan.speed import Speed

REFERENCE = Path(__file__).resolve().parent / "tradeoff" / "machine.json"


class Machine(Strict):
    """Speeds by preset, and whose they are."""

    name: str
    measured: str
    speeds: dict[str, Speed]


def machine_path() -> Path:
    """Where this machine's figures are kept."""
    named = os.environ.get("AIRLENS_MACHINE")
    return Path(named) if named else cache_folder() / "machine.json"


def this_machine() -> tuple[Machine, str]:
    """The figures to plan with, and a sentence on where they are from."""
    for path, words in (
        (machine_path(), "measured on this machine, {measured}"),
        (REFERENCE, "of another machine ({name}); measure this one: airlens bench calibrate"),
    ):
        try:
            machine = read_machine(path)
        except (FileNotFoundError, BadInputError):
            continue
        return machine, words.format(name=machine.name, measured=machine.measured)
    return Machine(name="", measured="", speeds={}), "not measured; run: airlens bench calibrate"


def read_machine(path: Path) -> Machine:
    """Read one machine's figures. Raises FileNotFoundError, BadInputError."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise BadInputError(f"{path} is not JSON ({error}); run: airlens bench calibrate") from None
    return parse(content, Machine, str(path))


def keep_machine(machine: Machine, path: Path) -> None:
    """Write the figures durably."""
    write_json(path, to_plain(machine))
