"""What a projector's own page shows."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel

PatternName = Literal["scene", "identify", "focus", "white", "grey", "black"]
State = Literal["empty", "waiting", "showing", "refused", "away"]


class ScreenResource(WireModel):
    """`showing` means that the kiosk page drew the picture and read back the very same pixels.

    `view` is the number of the first view that sees by the projector; `page` is where its page is.
    """

    device: Literal["screen"] = "screen"
    view: int
    state: State
    width_px: int | None
    height_px: int | None
    digest: str
    reason: str
    page: str


class ShowPattern(WireModel):
    """Which pattern of which experiment's projector, by the number of a view that sees by it."""

    experiment: Named
    pattern: PatternName
    view: int = Field(default=0, ge=0, lt=100)
