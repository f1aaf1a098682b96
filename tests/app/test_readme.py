"""What texts name is there: the functions on a frame's way (at most forty), files to touch, modules, links."""

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
        assert not name or re.search(rf"\b(?:def|class) {name}\b", text), f"{path}: {name}"
    for folder in re.findall(r"^\| `([^|]+)` \|", README, flags=re.MULTILINE):
        for name in re.findall(r"\w+", folder):
            assert (root / "app" / name / "__init__.py").is_file(), name


def _there(root: Path, dotted: str) -> bool:
    """Whether `app.rig.open.open_camera` is a module, or a name in one."""
    parts = dotted.split(".")
    for n in range(len(parts), 0, -1):
        place = root.joinpath(*parts[:n])
        for module in (place.with_suffix(".py"), place / "__init__.py"):
            if module.is_file():
                rest = parts[n : n + 1]
                return (
                    not rest or re.search(rf"\b{rest[0]}\b", module.read_text(encoding="utf-8")) is not None
                )
    return False


def test_every_module_that_a_text_or_a_docstring_names_exists():
    root = Path(app.__file__).parents[1]
    packages = ("app", "core", "drivers", "calibration")
    texts = [path for name in (*packages, "tests") for path in (root / name).rglob("*.py")]
    texts += [
        root / "README.md",
        *(path for name in (*packages, "tests") for path in (root / name).rglob("*.md")),
    ]
    named = re.compile(rf"`((?:{'|'.join(packages)})(?:\.\w+)+)`")
    gone = [
        f"{path.relative_to(root)}: {dotted}"
        for path in texts
        for dotted in named.findall(path.read_text(encoding="utf-8"))
        if not _there(root, dotted)
    ]
    assert gone == []
    assert not _there(root, "core.render.choice.choose")


def test_every_link_of_a_readme_leads_to_a_file():
    root = Path(app.__file__).parents[1]
    pages = [root / "README.md", root / "web" / "README.md"]
    pages += [
        page
        for name in ("app", "core", "drivers", "calibration", "tests")
        for page in (root / name).rglob("README.md")
    ]
    gone = [
        f"{page.relative_to(root)}: {link}"
        for page in pages
        for link in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))
        if "://" not in link and not (page.parent / link).exists()
    ]
    assert gone == []
