"""The table of extremes in the report of a test run: a line a stage, and every row in a file if asked.

`pytest tests/extremes --extremes-table FILE` writes all rows as Markdown. Hooks of `tests/conftest.py`;
rows come here from any worker as a property of their test.
"""

from collections import Counter
from pathlib import Path

PROPERTY = "extreme"
_rows: list[dict] = []


def pytest_runtest_logreport(report) -> None:
    if report.when == "call":
        _rows.extend(value for name, value in report.user_properties if name == PROPERTY)


def pytest_terminal_summary(terminalreporter, config) -> None:
    if not _rows:
        return
    terminalreporter.section("extremes")
    total = Counter(row["stage"] for row in _rows)
    terminalreporter.write_line(f"{'stage':<16}{'rows':>6}{'refused':>9}{'failed':>8}{'CPU s':>8}")
    for stage, count in total.items():
        rows = [row for row in _rows if row["stage"] == stage]
        refused, failed = (sum(row[k] == v for row in rows) for k, v in (("refusal", True), ("good", False)))
        seconds = sum(row["cpu_s"] for row in rows)
        terminalreporter.write_line(f"{stage:<16}{count:>6}{refused:>9}{failed:>8}{seconds:>8.1f}")
    seconds = sum(row["cpu_s"] for row in _rows)
    terminalreporter.write_line(f"{len(_rows)} rows in {seconds:.0f} CPU seconds.")
    path = config.getoption("--extremes-table")
    if path:
        Path(path).write_text(markdown(_rows), encoding="utf-8")


def markdown(rows: list[dict]) -> str:
    """All rows as one table."""
    lines = ["| stage | scene | expected | found | |", "|---|---|---|---|---|"]
    for row in sorted(rows, key=lambda r: (r["stage"], r["scene"])):
        cells = (row["stage"], row["scene"], row["expected"], row["found"], "" if row["good"] else "FAILED")
        lines.append("| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
