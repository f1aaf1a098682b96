"""What the projector's own page shows."""

from typing import Literal

from app.api.models.strict import Named, WireModel

PatternName = Literal["scene", "identify", "focus", "white", "grey", "black"]
State = Literal["empty", "waiting", "showing", "refused", "away"]


class ScreenResource(WireModel):
    """`showing` means that the kiosk page drew the picture and read back the very same pixels."""

    device: Literal["screen"] = "screen"
    state: State
    width_px: int | None
    height_px: int | None
    digest: str
    reason: str
    page: str = "/kiosk/page"


class ShowPattern(WireModel):
    """Which pattern of which experiment's projector."""

    experiment: Named
    pattern: PatternName
