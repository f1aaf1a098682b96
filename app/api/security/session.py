"""Exchange of the token, once, for a cookie that scripts cannot read."""

from fastapi import APIRouter, Response

from app.api.models.session import Session
from app.api.services import Given

router = APIRouter(tags=["session"])


@router.post("/session")
def open_session(given: Given, response: Response) -> Session:
    """Give the caller, who showed the token, a session cookie.

    The page does this with the token from the address's fragment, which browsers never send.
    """
    config = given.config
    response.set_cookie(
        config.cookie_name,
        given.access.cookie,
        httponly=True,
        samesite="strict",
        secure=config.secure_cookie,
        path="/",
    )
    return Session(state="open")


@router.delete("/session")
def close_session(given: Given, response: Response) -> Session:
    """Forget the session in this browser."""
    config = given.config
    response.delete_cookie(
        config.cookie_name, httponly=True, samesite="strict", secure=config.secure_cookie, path="/"
    )
    return Session(state="closed")
