"""Pictures for a projector: the scene's own pattern, and a few that help to set it up."""

from typing import Literal

import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.views import projectors, view_names
from core.pattern import make_pattern
from core.scene import CheckerPattern, ProjectedPattern
from drivers.display import Picture
from drivers.identify import identify_frame

PatternName = Literal["scene", "identify", "focus", "white", "grey", "black"]
FOCUS = CheckerPattern(square_px=8.0)
LEVELS = {"white": 255, "grey": 128, "black": 0}


def projected(experiment: Experiment, view: int = 0) -> ProjectedPattern:
    """Return what the projector of a view throws. Raises BadInputError for a view without a projector."""
    scene = experiment.settings.scene
    light = scene.views[view].light or scene.light
    if isinstance(light, ProjectedPattern):
        return light
    if len(scene.views) == 1:
        raise BadInputError(
            f"The light of {experiment.folder.name} is a printed texture: there is nothing to project. "
            "Choose an experiment whose light is a projector."
        )
    raise BadInputError(
        f"The light of the view {scene.views[view].name!r} is a printed texture: there is nothing to project. "
        "Choose a view whose light is a projector."
    )


def pattern_picture(experiment: Experiment, name: PatternName, view: int = 0) -> Picture:
    """Return the picture at the native size of a view's projector; of several, `identify` shows the view's name.

    Raises BadInputError, SettingError.
    """
    light = projected(experiment, view)
    cols, rows = light.projector.width_px, light.projector.height_px
    if name in LEVELS:
        return np.full((rows, cols), LEVELS[name], np.uint8)
    if name == "identify":
        named = view_names(experiment)[view] if len(projectors(experiment)) > 1 else ""
        return identify_frame(rows, cols, named)
    pattern = light.pattern if name == "scene" else FOCUS
    return np.rint(255 * make_pattern(pattern, rows, cols)).astype(np.uint8)
