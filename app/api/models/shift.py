"""How far the picture moved since the reference."""

from app.api.models.strict import WireModel


class ShiftResource(WireModel):
    """Shifts in camera pixels, (columns, rows), against the newest reference; `drift_px` is the border's."""

    reference: str
    age_s: float
    drift_px: list[float]
    drift_spread_px: float
    largest_px: float
    tiles: int
