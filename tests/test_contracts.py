"""The import contracts hold, and fail when violated: a contract that cannot fail guards nothing."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parent.parent
_PACKAGES = ("app", "calibration", "core", "drivers")


def run_contracts(folder):
    script = Path(sys.executable).parent / "lint-imports"
    return subprocess.run([script, "--no-cache"], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("module", "line", "broken"),
    [
        ("core/air.py", "import cv2", "core knows no hardware"),
        ("core/air.py", "import drivers.protocols", "core and drivers never meet"),
        ("drivers/protocols.py", "import jax", "drivers know no science"),
        ("calibration/bundle.py", "import drivers.protocols", "calibration takes images"),
        ("app/volume/score.py", "import drivers.simulated", "only app.rig.open"),
        ("core/air.py", None, None),
    ],
)
def test_a_wrong_import_breaks_its_contract(tmp_path, module, line, broken):
    for package in _PACKAGES:
        shutil.copytree(_ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(_ROOT / "pyproject.toml", tmp_path)
    if line:
        path = tmp_path / module
        path.write_text(path.read_text() + f"\n{line}  # noqa\n")
    ran = run_contracts(tmp_path)
    assert (ran.returncode == 0) is (line is None), ran.stdout
    if broken:
        assert any(broken in text and "BROKEN" in text for text in ran.stdout.splitlines())
