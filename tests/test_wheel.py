"""The wheel: everything in a folder of its own, so that no package of another project is written over."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from web.hatch_build import DIST, STAMP, fingerprint

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    if not STAMP.is_file() or STAMP.read_text(encoding="utf-8") != fingerprint():
        pytest.skip(f"{DIST} is not built from these sources; `make setup` builds it.")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return next(folder.glob("*.whl"))


def test_the_wheel_holds_one_folder_and_the_line_that_names_it(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        assert archive.read("airlens.pth").split() == [b"airlens"]
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"airlens", "airlens.pth"}
    inside = {name.split("/")[1] for name in names if name.startswith("airlens/")}
    assert inside == {"app", "core", "drivers", "calibration"}
    assert {"airlens/app/cli.py", "airlens/app/page/index.html"} <= set(names)


def test_what_is_installed_is_found_beside_another_project_of_the_same_names(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    other = tmp_path / "core"
    other.mkdir()
    (other / "__init__.py").write_text("")
    code = (
        "import site, sys; site.addsitedir(sys.argv[1])\n"
        "import drivers.errors\nfrom importlib.util import find_spec\n"
        "print(drivers.errors.__file__, find_spec('core').origin)"
    )
    # -S: none of this environment's packages, so that only what was unpacked can be found.
    told = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == [
        str(tmp_path / "airlens" / "drivers" / "errors.py"),
        str(other / "__init__.py"),
    ]
