"""The road that app/README.md tells: every function of it is there, and there are at most forty."""

import importlib
import re
from pathlib import Path

import app

README = (Path(app.__file__).parent / "README.md").read_text(encoding="utf-8")


def test_every_function_on_a_frames_way_in_exists():
    named = re.findall(r"^\d+\. `([\w.]+):([\w.]+)`$", README, flags=re.MULTILINE)
    assert 20 < len(named) <= 40
    assert len(set(named)) == len(named)
    for module, path in named:
        found = importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
        assert callable(found), f"{module}:{path}"


def test_every_file_and_function_that_is_told_to_be_touched_exists():
    root = Path(app.__file__).parents[1]
    for path, name in re.findall(r"`((?:app|core)/[\w/.]+\.py)(?:: (\w+))?`", README):
        text = (root / path).read_text(encoding="utf-8")
        assert not name or f"def {name}(" in text, f"{path}: {name}"
    for folder in re.findall(r"^\| `([^|]+)` \|", README, flags=re.MULTILINE):
        for name in re.findall(r"\w+", folder):
            assert (root / "app" / name / "__init__.py").is_file(), name
