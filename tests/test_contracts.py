"""The import contracts hold, and fail when violated: a contract that cannot fail guards nothing."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parent.parent
_PACKAGES = ("app", "calibration", "core", "drivers")

# A module, a line that it must not hold, and the contract that refuses it.
WRONG = [
    ("core/air.py", "import cv2", "core knows no hardware, no files, no web"),
    (
        "core/air.py",
        "import drivers.protocols",
        "app composes; calibration bridges; core and drivers never meet",
    ),
    ("drivers/protocols.py", "import jax", "drivers know no science"),
    ("calibration/bundle.py", "import drivers.protocols", "calibration takes images, not devices"),
    ("app/volume/score.py", "import drivers.simulated", "only app.rig.open uses the simulated twins"),
    ("app/files/durable.py", "import app.experiment.folder", "the rooms of app stand on one another"),
    ("app/report/figures.py", "import app.jobs.ledger", "the rooms of app stand on one another"),
    ("app/jobs/study.py", "import app.bench.rays", "the rooms of app stand on one another"),
    ("core/room/march.py", "import core.estimate.observation", "the rooms of core stand on one another"),
    ("core/fields/field.py", "import core.render", "the rooms of core stand on one another"),
    ("app/api/models/jobs.py", "import fastapi", "what crosses the API needs nothing of the service"),
]


def run_contracts(folder):
    script = Path(sys.executable).parent / "lint-imports"
    return subprocess.run([script, "--no-cache"], cwd=folder, capture_output=True, text=True, check=False)


def test_the_contracts_hold():
    ran = run_contracts(_ROOT)
    assert ran.returncode == 0, ran.stdout


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What is said of a copy that holds every wrong import at once, by contract."""
    folder = tmp_path_factory.mktemp("wrong")
    for package in _PACKAGES:
        shutil.copytree(_ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(_ROOT / "pyproject.toml", folder)
    for module, line, _ in WRONG:
        path = folder / module
        path.write_text(f"{path.read_text()}\n{line}  # noqa\n")
    ran = run_contracts(folder)
    assert ran.returncode != 0
    details = ran.stdout.split("Broken contracts")[1]
    # A contract's name, underlined, and what it says until the next one.
    parts = re.split(r"\n([^\n]+)\n-{4,}\n", details)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize(("module", "line", "contract"), WRONG)
def test_a_wrong_import_breaks_its_contract(told, module, line, contract):
    importer, imported = module.removesuffix(".py").replace("/", "."), line.removeprefix("import ")
    assert re.search(rf"{re.escape(importer)} -> {re.escape(imported)} \(l\.\d+\)", told[contract]), told


def test_every_contract_is_tried():
    kept = tomllib.loads((_ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    assert {contract["name"] for contract in kept} == {contract for _, _, contract in WRONG}
