"""The page's types of the API are those that the service describes."""

import importlib.util
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "web" / "schema.py"


def test_the_generated_types_are_those_of_this_description():
    spec = importlib.util.spec_from_file_location("page_schema", SOURCE)
    schema = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(schema)
    first, types = schema.SCHEMA.read_text(encoding="utf-8").split("\n", 1)
    assert f"{first}\n" == schema.header(schema.description(), types), (
        "The API changed, or schema.ts was edited by hand: run `make types`."
    )
