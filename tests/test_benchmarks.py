"""The list of benchmarks in their README is the folder's."""

from tests.benchmarks.__main__ import HERE, table


def test_the_readme_lists_every_benchmark():
    assert table() in (HERE / "README.md").read_text(encoding="utf-8")
