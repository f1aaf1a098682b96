"""Does the camera see the scene's pattern as it was sent? On the real rig, or on the simulated one."""

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.rig.open import open_stage, panel_of
from app.rig.screens import open_screen
from app.rig.stage import Stage, StageTask
from core.pattern.make import make_pattern
from drivers.pattern_check import check_pattern
from drivers.verdict import Verdict


def check_projector(experiment: Experiment, screen: str, port: int, say: Callable[[str], object]) -> Verdict:
    """Show the identify frame, then the pattern, which stays on screen; return what the camera saw.

    Raises BadInputError for a scene without projector, DeviceError when the frame is not seen.
    """
    scene = experiment.settings.scene
    panel = panel_of(scene)
    if panel is None:
        raise BadInputError("The scene's light is no projector: there is nothing to check.")
    pattern = make_pattern(scene.light.pattern, panel[1], panel[0])
    picture = np.rint(255 * np.clip(pattern, 0, 1)).astype(np.uint8)
    with _stage(experiment, screen, port, say) as stage, stage.camera as camera:
        stage.arrange(StageTask("light", "Leave the wall bare."))
        if stage.display is None:
            raise BadInputError("The rig has no screen to show a pattern with.")
        return check_pattern(stage.display, camera, picture)


@contextlib.contextmanager
def _stage(experiment: Experiment, screen: str, port: int, say: Callable[[str], object]) -> Iterator[Stage]:
    if experiment.settings.rig.camera_kind == "simulated":
        yield open_stage(experiment, None)
        return
    with open_screen(screen, port, say) as display:
        yield open_stage(experiment, None, display)
