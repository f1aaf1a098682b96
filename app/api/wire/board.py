"""The board of a request as experiment.toml keeps it."""

from app.api.models.board import BoardGeometry
from app.experiment.rig_settings import BoardSettings


def board_settings(geometry: BoardGeometry) -> BoardSettings:
    """The same for experiment.toml. Raises BadInputError for a board that cannot be."""
    found = BoardSettings(**geometry.model_dump())
    found.board()
    return found
