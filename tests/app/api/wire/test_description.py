"""The OpenAPI description is complete and true."""

import pytest

from tests.app.api.conftest import Live
from tests.benchmarks.fuzz_api import fuzz


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


@pytest.mark.filterwarnings("ignore")
def test_generated_requests_are_answered_as_described(live: Live):
    """The short form of tests/benchmarks/fuzz_api.py."""
    counts = fuzz(live.app.openapi(), live.url, live.bearer, cases=150)
    assert counts["cases"] >= 75
    assert counts["server errors"] == 0
