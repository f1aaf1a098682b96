"""Files that an operator sends: PNG, JPEG, TIFF, NPY and NPZ, as the raw body of one request."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from pydantic import ValidationError

from app.api.models.uploads import Upload
from app.api.services import Given
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.errors import BadInputError

router = APIRouter(tags=["uploads"])
FileName = Annotated[
    str, Query(max_length=255, description="What its sender calls the file: what is said of it names it so.")
]
BINARY = {"schema": {"type": "string", "format": "binary"}}
BODY = {"requestBody": {"required": True, "content": {"application/octet-stream": BINARY}}}


@router.get("/uploads")
def list_uploads(given: Given) -> list[Upload]:
    """List the uploads, newest first."""
    return [_line(manifest) for manifest in given.uploads.list()]


def _line(manifest: dict[str, Any]) -> Upload:
    name = str(manifest.get("upload", ""))
    if "reason" in manifest:
        return Upload(upload=name, kind="broken", reason=str(manifest["reason"]))
    try:
        return Upload.model_validate(manifest)
    except ValidationError:
        reason = (
            f"The manifest of {name} has other fields than an upload's. Delete it and send the file again."
        )
        return Upload(upload=name, kind="broken", reason=reason)


@router.post("/uploads", status_code=201, openapi_extra=BODY)
async def add_upload(given: Given, request: Request, name: FileName = "") -> Upload:
    """Stream a file in, check what it declares, read it in a limited process, keep its arrays."""
    if request.headers.get("content-type") != "application/octet-stream":
        raise ApiError("media_type_refused", "An upload is sent as application/octet-stream.")
    try:
        return Upload.model_validate(await given.uploads.add(request.stream(), name))
    except BadInputError as error:
        # Nothing more of a refused file is read.
        said = f"{name}: {error}" if name else str(error)
        raise ApiError("content_refused", said, headers={"Connection": "close"}) from error


@router.delete("/uploads/{upload}", status_code=204)
def delete_upload(given: Given, upload: Identifier) -> None:
    """Remove an upload."""
    if not given.uploads.delete(upload):
        raise ApiError("not_found", f"There is no upload {upload!r}.")
