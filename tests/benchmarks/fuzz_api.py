"""Sends generated requests, valid and invalid, to every operation of a live service; one JSON line at the end.

    python -m tests.benchmarks.fuzz_api --cases 5000

Counts server errors (5xx but for 503, which says that there is no camera) and answers that disagree with
the OpenAPI description.
"""

import argparse
import json
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from app.api.factory import create_app
from app.api.security.settings import Limits, new_token, service_config
from app.api.server import listen, serving

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=5000)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        bound = listen("127.0.0.1", 0)
        token = new_token()
        limits = Limits(reads_per_s=1e9, writes_per_s=1e9, failures_per_s=1e9)
        app = create_app(service_config(Path(folder), token, bound.getsockname()[1], limits=limits))
        with serving(app, bound) as port:
            started_s = time.perf_counter()
            headers = {"Authorization": f"Bearer {token}"}
            counts = fuzz(app.openapi(), f"http://127.0.0.1:{port}", headers, options.cases)
            print(json.dumps({"wall_s": round(time.perf_counter() - started_s, 1), **counts}))


if __name__ == "__main__":
    main()
