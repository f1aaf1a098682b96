"""List the benchmarks: `python -m tests.benchmarks` prints the table of this folder's README."""

import ast
from pathlib import Path

HERE = Path(__file__).resolve().parent


def table() -> str:
    """One line a benchmark: its name and the first paragraph of what it says of itself."""
    lines = ["| benchmark | what it measures |", "|---|---|"]
    for path in sorted(HERE.glob("[a-z]*.py")):
        about = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
        if path.stem != "options":
            lines.append(f"| `{path.stem}` | {' '.join(about.split())} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")
