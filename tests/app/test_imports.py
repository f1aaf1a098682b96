"""What is quick to begin stays so: no module loads what it does not need at once. Counts modules, not time."""

import json
import os
import subprocess
import sys

import pytest

from app.bench import BENCHES
from app.commands import COMMANDS
from app.commands.calibrate import STEPS
from app.commands.lazy import commands_of
from app.commands.print import SHEETS
from app.reconstruct.names import NAMES
from app.reconstruct.presets import PRESETS

# Each costs between a third of a second and several.
HEAVY = (
    "jax",
    "cv2",
    "scipy",
    "skimage",
    "matplotlib",
    "fastapi",
    "starlette",
    "xarray",
    "equinox",
    "h5netcdf",
    "reportlab",
)


def loaded_by(code, names):
    """Those of `names` that are loaded once `code` ran in a process of its own."""
    asked = f"import sys\nprint(*[name for name in {names!r} if name in sys.modules])"
    ran = subprocess.run(
        [sys.executable, "-P", "-c", f"{code}\n{asked}"], capture_output=True, text=True, check=True
    )
    return ran.stdout.splitlines()[-1].split()


def test_a_notebook_imports_the_client_without_the_service():
    assert loaded_by("import app.client", HEAVY) == []


def test_what_is_loaded_is_found():
    assert loaded_by("import app.api.factory", HEAVY[:2]) == ["jax", "cv2"]


# Each command's help in turn, in one process; prints which command loaded which heavy module first.
HELP = """
import json, sys
from typer.testing import CliRunner
from app.cli import create_cli
from app.commands import COMMANDS
blame = {}
for words in [[], *([name] for name in COMMANDS)]:
    shown = CliRunner().invoke(create_cli(), [*words, "--help"], catch_exceptions=False)
    assert shown.exit_code == 0 and "Usage" in shown.output
    for name in HEAVY:
        if name in sys.modules:
            blame.setdefault(name, words)
print(json.dumps(blame))
"""


def test_no_help_loads_what_a_command_computes_with():
    code = f"HEAVY = {(*HEAVY, 'app.pipeline')!r}\n{HELP}"
    ran = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(ran.stdout) == {}


@pytest.mark.parametrize(
    ("words", "offered"), [("airlens re", "reconstruct"), ("airlens reconstruct --preset ", "standard")]
)
def test_completion_offers_words_and_loads_nothing_heavy(words, offered):
    code = (
        "import sys, atexit\n"
        f"atexit.register(lambda: print('loaded', *[name for name in {HEAVY!r} if name in sys.modules]))\n"
        "sys.argv = ['airlens']\nfrom app.cli import main\nmain()"
    )
    asked = {"_AIRLENS_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    ran = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True, env=os.environ | asked
    )
    lines = ran.stdout.splitlines()
    assert offered in lines
    assert lines[-1] == "loaded"


@pytest.mark.parametrize(
    "table", [COMMANDS, BENCHES, STEPS, SHEETS], ids=["commands", "benches", "steps", "sheets"]
)
def test_the_tables_of_commands_say_what_the_modules_register(table):
    registered = {
        name: (module, command.get_short_help_str(400))
        for module in {module for module, _ in table.values()}
        for name, command in commands_of(module).items()
    }
    assert registered == dict(table)


def test_the_presets_that_are_completed_are_those_that_there_are():
    assert set(NAMES) == {"auto", *PRESETS}


@pytest.mark.parametrize("order", ["import core.setting, jax", "import jax, core.setting"])
def test_core_multiplies_matrices_as_exactly_as_the_processor_can(order):
    code = f"{order}\nprint(jax.config.jax_default_matmul_precision)"
    told = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["highest"]
