"""The OpenAPI description: complete, with the one error shape and the two ways to show the token."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.api.models.problem import MEDIA_TYPE, ProblemDetails

PROBLEM = {"$ref": "#/components/schemas/ProblemDetails"}
ERROR = {"description": "What happened, why, and what to do.", "content": {MEDIA_TYPE: {"schema": PROBLEM}}}


def describe(app: FastAPI) -> None:
    """Make `app.openapi()` tell what the service does, errors included."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _description(app)
        return app.openapi_schema

    app.openapi = openapi


def _description(app: FastAPI) -> dict[str, Any]:
    found = get_openapi(title=app.title, version=app.version, summary=app.summary, routes=app.routes)
    for path in found["paths"].values():
        for operation in path.values():
            operation["responses"] = {
                **{k: v for k, v in operation["responses"].items() if k != "422"},
                "4XX": ERROR,
                "5XX": ERROR,
            }
    components = found.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    described = ProblemDetails.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update({**described.pop("$defs", {}), "ProblemDetails": described})
    components["securitySchemes"] = {"bearer": {"type": "http", "scheme": "bearer"}}
    found["security"] = [{"bearer": []}]
    return found
