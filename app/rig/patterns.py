"""Pictures for the projector: the scene's own pattern, and a few that help to set it up."""

from typing import Literal

import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment
from core.pattern import make_pattern
from core.scene import CheckerPattern, ProjectedPattern
from drivers.display import Picture
from drivers.identify import identify_frame

PatternName = Literal["scene", "identify", "focus", "white", "grey", "black"]
FOCUS = CheckerPattern(square_px=8.0)
LEVELS = {"white": 255, "grey": 128, "black": 0}


def panel_px(experiment: Experiment) -> tuple[int, int]:
    """Return the projector's native columns and rows. Raises BadInputError for a rig without a projector."""
    light = experiment.settings.scene.light
    if not isinstance(light, ProjectedPattern):
        raise BadInputError(
            f"The light of {experiment.folder.name} is a printed texture: there is nothing to project. "
            "Choose an experiment whose light is a projector."
        )
    return light.projector.width_px, light.projector.height_px


def pattern_picture(experiment: Experiment, name: PatternName) -> Picture:
    """Return the picture at the projector's native size. Raises BadInputError, SettingError."""
    cols, rows = panel_px(experiment)
    light = experiment.settings.scene.light
    if name in LEVELS:
        return np.full((rows, cols), LEVELS[name], np.uint8)
    if name == "identify":
        return identify_frame(rows, cols)
    pattern = light.pattern if name == "scene" else FOCUS
    return np.rint(255 * make_pattern(pattern, rows, cols)).astype(np.uint8)
