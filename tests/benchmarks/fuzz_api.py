"""Sends generated requests, valid and invalid, to every operation of a live service; one JSON line at the end.

    python -m tests.benchmarks.fuzz_api --cases 5000

Counts server errors (5xx but for 503, which says that there is no camera) and answers that disagree with
the OpenAPI description.
"""

import argparse
import json
import random
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from tests.benchmarks.served import unlimited

CHECKS = [
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
    response_headers_conformance,
]
# These never end.
STREAMS = ("/api/events", "/api/devices/camera/live.mjpeg")


def fuzz(description: Mapping[str, Any], url: str, headers: Mapping[str, str], cases: int) -> Counter[str]:
    """Send about `cases` requests; return counts by status class. Raises on the first disagreement."""
    schema = schemathesis.openapi.from_dict(dict(description))
    operations = [found.ok() for found in schema.get_all_operations()]
    operations = [operation for operation in operations if operation.path not in STREAMS]
    counts: Counter[str] = Counter()
    each = max(1, cases // (2 * len(operations)))
    for operation in operations:
        for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
            _fuzz_one(operation, mode, url, dict(headers), each, counts)
    return counts


def _fuzz_one(
    operation: Any, mode: GenerationMode, url: str, headers: dict[str, str], cases: int, counts: Counter[str]
) -> None:
    @settings(
        max_examples=cases,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.explicit, Phase.generate],
    )
    @given(case=operation.as_strategy(mode))
    def send(case: Any) -> None:
        answer = case.call(base_url=url, headers=headers, timeout=30)
        counts[f"{answer.status_code // 100}xx"] += 1
        counts["cases"] += 1
        if answer.status_code >= 500 and answer.status_code != 503:
            counts["server errors"] += 1
            raise AssertionError(f"{operation.label}: {answer.status_code} {answer.text[:300]}")
        case.validate_response(answer, checks=CHECKS, headers=headers)

    try:
        send()
    except schemathesis.errors.InvalidSchema:
        counts["not generated"] += 1


def extremes(
    description: Mapping[str, Any],
    url: str,
    headers: Mapping[str, str],
    cases: int,
    seed: int = 0,
    experiment: str = "word",
) -> Counter[str]:
    """Send `cases` requests whose values are at and beyond every limit; return counts by status class.

    Most requests about an experiment name `experiment`.
    """
    dice, counts = random.Random(seed), Counter[str]()
    maker = Extremes(description, dice, experiment)
    operations = [
        (method.upper(), path, operation)
        for path, item in description["paths"].items()
        for method, operation in item.items()
        if path not in STREAMS
    ]
    with httpx.Client(base_url=url, headers=dict(headers), timeout=60, trust_env=False) as http:
        for number in range(cases):
            method, path, operation = operations[number % len(operations)]
            where, query, body = maker.request(path, operation)
            content = (
                {} if body is None else {"content": body, "headers": {"Content-Type": "application/json"}}
            )
            answer = http.request(method, where, params=query, **content)
            counts["cases"] += 1
            counts[f"{answer.status_code // 100}xx"] += 1
            if answer.status_code >= 500 and answer.status_code != 503:
                counts["server errors"] += 1
                print(
                    method,
                    where[:200],
                    (body or b"")[:300],
                    answer.status_code,
                    answer.text[:300],
                    flush=True,
                )
    return counts


class Extremes:
    """Makes requests from the description, each value sound or extreme as the dice fall."""

    def __init__(self, description: Mapping[str, Any], dice: random.Random, experiment: str) -> None:
        self._schemas = description["components"]["schemas"]
        self._dice = dice
        self._experiment = experiment

    def request(self, path: str, operation: Mapping[str, Any]) -> tuple[str, dict[str, str], bytes | None]:
        """Return the address, the query and the body of one request."""
        query = {}
        for parameter in operation.get("parameters", []):
            text = (
                str(self._named(parameter["name"], parameter["schema"])).encode("utf-8", "replace").decode()
            )
            if parameter["in"] == "path":
                path = path.replace("{" + parameter["name"] + "}", quote(text[:500] or "x", safe=""))
            elif parameter["in"] == "query" and self._dice.random() < 0.7:
                query[parameter["name"]] = text[:5000]
        content = operation.get("requestBody", {}).get("content", {})
        if "application/json" not in content:
            return path, query, None
        if self._dice.random() < 0.03:
            return path, query, self._dice.choice(RAW)
        return path, query, json.dumps(self._value(content["application/json"]["schema"])).encode()

    def _named(self, name: str, schema: Mapping[str, Any], depth: int = 0) -> Any:
        known = name == "experiment" and self._dice.random() < 0.8
        return self._experiment if known else self._value(schema, depth)

    def _value(self, schema: Mapping[str, Any], depth: int = 0) -> Any:
        if "$ref" in schema:
            schema = self._schemas[schema["$ref"].rsplit("/", 1)[-1]]
        if self._dice.random() < 0.15 or depth > 8:
            return self._extreme()
        if "anyOf" in schema:
            return self._value(self._dice.choice(schema["anyOf"]), depth + 1)
        if "enum" in schema or "const" in schema:
            return self._dice.choice(schema.get("enum", [schema.get("const")]))
        kind = schema.get("type")
        if kind == "object":
            if "properties" not in schema:
                return {self._dice.choice(("trials", "seed", "preset", "frames", "a")): self._extreme()}
            needed = schema.get("required", [])
            return {
                name: self._named(name, part, depth + 1)
                for name, part in schema["properties"].items()
                if name in needed or self._dice.random() < 0.5
            }
        if kind == "array":
            parts = schema.get("prefixItems") or [schema.get("items", {})] * self._dice.choice((0, 1, 4))
            return [self._value(part, depth + 1) for part in parts]
        sound = {"string": "word", "integer": 1, "number": 1.0, "boolean": True}
        return sound.get(str(kind)) if "minimum" not in schema else schema["minimum"]

    def _extreme(self) -> Any:
        sign, power = self._dice.choice((1, -1)), self._dice.randrange(41)
        return self._dice.choice(
            (sign * 10**power, sign * 10**power, sign * 10**40, 2**63, float(10**power), 5e-324, 1.7e308, -0.0,
             float("nan"), float("inf"), True, None, "", "x" * 20_000, "\0", "\ud800", "../..", "\u202e", "1e9999",
             str(10**power), [], {}, [[[[]]]], {"a": {"a": {}}})
        )  # fmt: skip


RAW = (
    b"",
    b"{",
    b"[" * 50_000,
    b'{"a":' * 50_000,
    b"9" * 6000,
    b'{"title": ' + b"9" * 6000 + b"}",
    b"\xff\xfe",
    b"null",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--extremes", type=int, default=5000, help="requests with extreme values")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        with unlimited(Path(folder)) as service:
            started_s = time.perf_counter()
            url, headers, description = service.url, service.headers, service.app.openapi()
            counts = Counter[str]()
            if options.cases:
                counts += fuzz(description, url, headers, options.cases)
            made = httpx.post(
                f"{url}/api/experiments",
                json={"kind": "simulated", "camera_px": 64, "world": "ideal"},
                headers=headers,
                timeout=60,
            )
            name = made.json()["experiment"]
            counts += extremes(description, url, headers, options.extremes, experiment=name)
            print(json.dumps({"wall_s": round(time.perf_counter() - started_s, 1), **counts}))


if __name__ == "__main__":
    main()
