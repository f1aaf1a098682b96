"""List the benchmarks: `python -m tests.benchmarks` a line each."""

import ast
from pathlib import Path

HERE = Path(__file__).resolve().parent


def listing() -> str:
    """One line a benchmark: its name and the first paragraph of what it says of itself."""
    lines = []
    for path in sorted(HERE.glob("[a-z]*.py")):
        about = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
        if path.stem not in ("options", "served") and about:
            lines.append(f"{path.stem:16} {' '.join(about.split())}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(listing(), end="")
