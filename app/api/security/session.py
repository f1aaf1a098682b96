"""Exchange of the token, once, for a cookie that scripts cannot read."""

from fastapi import APIRouter, Request, Response

from app.api.models.session import Session
from app.api.services import Given

router = APIRouter(tags=["session"])


@router.post("/session")
def open_session(given: Given, request: Request, response: Response) -> Session:
    """Give the caller, who showed the token, a session cookie.

    The page does this with the token from the address's fragment, which browsers never send.
    """
    config = given.config
    response.set_cookie(
        config.cookie_name,
        given.access.sessions.open(request.headers["host"]),
        httponly=True,
        samesite="strict",
        secure=config.secure_cookie,
        path="/",
    )
    return Session(state="open")


@router.delete("/session")
def close_session(given: Given, request: Request, response: Response) -> Session:
    """End the session: its cookie opens nothing any more, wherever it is."""
    config = given.config
    given.access.sessions.close(request.cookies.get(config.cookie_name, ""))
    response.delete_cookie(
        config.cookie_name, httponly=True, samesite="strict", secure=config.secure_cookie, path="/"
    )
    return Session(state="closed")
