"""The browser's session."""

from typing import Literal

from app.api.models.strict import WireModel


class Session(WireModel):
    """Whether the browser holds the cookie that opens the service."""

    state: Literal["open", "closed"]
