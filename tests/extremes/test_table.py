"""The table as a whole: how many rows, and none twice."""

import importlib
from pathlib import Path

from tests.extremes.row import Row


def every_row() -> list[Row]:
    names = sorted(path.stem for path in Path(__file__).parent.glob("test_*.py"))
    modules = [importlib.import_module(f"tests.extremes.{name}") for name in names if name != "test_table"]
    return [row for module in modules for row in getattr(module, "ROWS", [])]


def test_the_table_has_at_least_three_hundred_rows_and_none_twice():
    names = [str(row) for row in every_row()]

    assert len(names) >= 300
    assert sorted(set(names)) == sorted(names)
