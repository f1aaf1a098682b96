"""The browser's session."""

from typing import Literal

from app.api.models.strict import Strict


class Session(Strict):
    """Whether the browser holds the cookie that opens the service."""

    state: Literal["open", "closed"]
