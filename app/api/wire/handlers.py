"""Turns every exception into the one error shape."""

import errno
import logging
import secrets
from http import HTTPStatus

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from app.api.models.problem import MEDIA_TYPE, FieldError
from app.api.security.headers import headers_for
from app.api.wire.problems import ApiError, body_of
from app.errors import AirlensError, BadInputError
from app.jobs import EngineError, JobError, LedgerError, UnknownJobError
from calibration.errors import CalibrationError
from core.setting import SettingError
from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError, DeviceSettingError

CODES = {
    HTTPStatus.NOT_FOUND: "not_found",
    HTTPStatus.METHOD_NOT_ALLOWED: "method_not_allowed",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "too_large",
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE: "media_type_refused",
    HTTPStatus.SERVICE_UNAVAILABLE: "unavailable",
}


def add_handlers(app: FastAPI) -> None:
    """Give `app` one shape for every error, including those that the framework raises itself."""
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(RequestValidationError, _validation)
    app.add_exception_handler(BadInputError, _bad_input)
    app.add_exception_handler(SettingError, _bad_input)
    app.add_exception_handler(CalibrationError, _bad_input)
    app.add_exception_handler(DeviceError, _device)
    app.add_exception_handler(AirlensError, _failed)
    app.add_exception_handler(UnknownJobError, _unknown_job)
    app.add_exception_handler(JobError, _conflict)
    app.add_exception_handler(LedgerError, _unavailable)
    app.add_exception_handler(EngineError, _unavailable)
    app.add_exception_handler(OSError, _os)
    app.add_exception_handler(Exception, _internal)


def respond(error: ApiError, instance: str | None = None) -> Response:
    """Return the response that shows `error`."""
    return Response(body_of(error, instance), error.status_code, error.headers, MEDIA_TYPE)


def _http(request: Request, error: Exception) -> Response:
    if isinstance(error, ApiError):
        return respond(error)
    if not isinstance(error, HTTPException):
        return _internal(request, error)
    code = CODES.get(HTTPStatus(error.status_code), "bad_request")
    causes = {
        "not_found": "There is nothing at this address.",
        "method_not_allowed": f"{request.method} is not possible at this address.",
    }
    return respond(ApiError(code, causes.get(code, str(error.detail)), headers=error.headers))


def _validation(_request: Request, error: Exception) -> Response:
    found = error.errors() if isinstance(error, RequestValidationError) else []
    errors = [
        FieldError(field=".".join(str(part) for part in item["loc"]), message=str(item["msg"]))
        for item in found[:20]
    ]
    # Where a value was sent is told under `errors`; a reader knows it by its name.
    named = ", ".join(f"{_bare(item.field)} ({item.message})" for item in errors[:3])
    return respond(ApiError("invalid", f"Not accepted: {named or 'the request'}.", errors=errors))


def _bare(field: str) -> str:
    place, _, name = field.partition(".")
    return name if name and place in ("body", "query", "path", "header") else field


def _bad_input(_request: Request, error: Exception) -> Response:
    return respond(_in_its_words("bad_input", error))


def _failed(_request: Request, error: Exception) -> Response:
    return respond(_in_its_words("failed", error))


def _in_its_words(code: str, error: Exception, next_step: str | None = None) -> ApiError:
    """What an error says after its first sentence is what to do; `next_step` where it says no more."""
    cause, _, what_to_do = str(error).partition(". ")
    return ApiError(code, f"{cause}.", what_to_do) if what_to_do else ApiError(code, cause, next_step)


def _unknown_job(_request: Request, error: Exception) -> Response:
    return respond(ApiError("not_found", str(error)))


def _conflict(_request: Request, error: Exception) -> Response:
    return respond(ApiError("conflict", str(error)))


def _unavailable(_request: Request, error: Exception) -> Response:
    return respond(ApiError("unavailable", str(error)))


def _device(_request: Request, error: Exception) -> Response:
    if isinstance(error, DeviceBusyError):
        return respond(_in_its_words("conflict", error))
    if isinstance(error, DeviceSettingError):
        return respond(_in_its_words("bad_input", error))
    code = "not_found" if isinstance(error, DeviceNotFoundError) else "device_failed"
    return respond(_in_its_words(code, error, "Check cable and power, then reconnect the device."))


# What the disk says, in the operator's words: code, cause.
DISK = {
    **dict.fromkeys(
        (errno.ENOSPC, errno.EDQUOT, errno.EFBIG), ("disk_full", "The data disk has no space left.")
    ),
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS),
        ("not_writable", "The data folder cannot be written or read."),
    ),
    **dict.fromkeys(
        (errno.ENOENT, errno.ENOTDIR, errno.ESTALE), ("not_found", "It was removed while it was used.")
    ),
    **dict.fromkeys(
        (errno.EEXIST, errno.ENOTEMPTY, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG),
        ("conflict", "Something else is in its place in the data folder."),
    ),
    **dict.fromkeys(
        (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN),
        ("unavailable", "The machine has no files or no memory left for this."),
    ),
}


def _os(request: Request, error: Exception) -> Response:
    known = DISK.get(error.errno or 0) if isinstance(error, OSError) else None
    return _internal(request, error) if known is None else respond(ApiError(*known))


def _internal(request: Request, error: Exception) -> Response:
    instance = secrets.token_hex(6)
    logging.getLogger("airlens.api").error(
        "incident %s at %s %s", instance, request.method, request.url.path, exc_info=error
    )
    # This answer is made outside the guard, which would else have set the headers.
    headers = headers_for(request.url.path)
    return respond(
        ApiError("internal", f"An unforeseen {type(error).__name__} happened.", headers=headers), instance
    )
