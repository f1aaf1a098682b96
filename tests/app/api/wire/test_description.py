"""The OpenAPI description is complete and true."""

from collections.abc import Mapping
from typing import Any

import pytest

from tests.app.api.conftest import Live
from tests.benchmarks.fuzz_api import extremes, fuzz


def test_every_operation_is_typed_and_describes_its_errors(live: Live):
    for path, item in live.app.openapi()["paths"].items():
        for method, operation in item.items():
            answers = operation["responses"]
            assert "4XX" in answers, (method, path)
            good = next(code for code in answers if code.startswith("2"))
            content = answers[good].get("content", {})
            assert good == "204" or content, (method, path)
            for media, body in content.items():
                assert media != "application/json" or body["schema"], (method, path)


def test_every_body_is_closed(live: Live):
    for name, schema in live.app.openapi()["components"]["schemas"].items():
        if "properties" in schema:
            assert schema.get("additionalProperties") is False, name


def unbounded(schema: Any, schemas: Mapping[str, Any], where: str) -> list[str]:
    """Numbers, texts and lists below `schema` that a request may make as large as it likes."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[-1]
        return unbounded(schemas[name], schemas, where)
    found = []
    kind = schema.get("type")
    if "enum" in schema or "const" in schema:
        return []
    if kind in ("integer", "number"):
        lower, upper = ({"minimum", "exclusiveMinimum"}, {"maximum", "exclusiveMaximum"})
        found += [] if lower & schema.keys() and upper & schema.keys() else [where]
    if kind == "string" and not {"maxLength", "pattern", "format"} & schema.keys():
        found.append(where)
    if kind == "array":
        found += [] if "maxItems" in schema else [where]
        found += unbounded(schema.get("items", {}), schemas, where + "[]")
    for part in (*schema.get("anyOf", []), *schema.get("oneOf", []), *schema.get("prefixItems", [])):
        found += unbounded(part, schemas, where)
    for name, part in schema.get("properties", {}).items():
        found += unbounded(part, schemas, f"{where}.{name}")
    return found


def test_every_value_of_every_request_is_bounded(live: Live):
    described = live.app.openapi()
    schemas, found = described["components"]["schemas"], []
    for path, item in described["paths"].items():
        for method, operation in item.items():
            for parameter in operation.get("parameters", []):
                found += unbounded(parameter["schema"], schemas, f"{method} {path} {parameter['name']}")
            content = operation.get("requestBody", {}).get("content", {})
            for body in content.values():
                found += unbounded(body["schema"], schemas, f"{method} {path}")
    assert found == []


@pytest.mark.filterwarnings("ignore")
def test_generated_requests_are_answered_as_described(live: Live):
    """The short form of tests/benchmarks/fuzz_api.py."""
    counts = fuzz(live.app.openapi(), live.url, live.bearer, cases=150)
    assert counts["cases"] >= 75
    assert counts["server errors"] == 0


def test_extreme_values_are_refused_and_never_a_fault(live: Live):
    """The short form of tests/benchmarks/fuzz_api.py --extremes."""
    counts = extremes(live.app.openapi(), live.url, live.bearer, cases=300)
    assert counts["cases"] == 300
    assert counts["server errors"] == 0
