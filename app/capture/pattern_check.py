"""Do the cameras see the patterns as they were sent? On the real rig, or on the simulated one."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.views import chosen_projectors
from app.rig.lamps import Lamps
from app.rig.open import open_stage
from app.rig.patterns import pattern_picture
from app.rig.screens import open_screens
from app.rig.stage import StageTask
from drivers.display import PatternDisplay, Picture
from drivers.errors import DeviceError
from drivers.pattern_check import check_pattern
from drivers.verdict import Verdict


def check_projectors(
    experiment: Experiment,
    screen: str,
    port: int,
    say: Callable[[str], object],
    view: str | None = None,
    lamps: Lamps | None = None,
) -> Iterator[tuple[str, Verdict | DeviceError]]:
    """Yield whose each projector is, where there are several views, and what its camera saw or what went wrong.

    Each shows the identify frame, then its pattern, which stays on screen; where several light one wall the others
    are dark (`lamps`). `view` names the view whose projector alone is checked. Raises BadInputError for a scene
    without a projector, AirlensError for a projector that does not do as it is told.
    """
    whose = chosen_projectors(experiment, view)
    pictures = {number: pattern_picture(experiment, "scene", number) for number in whose}
    lamps = lamps or Lamps(experiment)
    simulated = experiment.settings.rig.camera_kind == "simulated"
    with nullcontext({}) if simulated else open_screens(screen, whose, port, say) as displays:
        for number, name in whose.items():
            try:
                lamps.light(number)
                found = _checked(experiment, number, displays.get(number), pictures[number])
            except DeviceError as error:
                found = error
            yield name, found


def _checked(
    experiment: Experiment, number: int, display: PatternDisplay | None, picture: Picture
) -> Verdict:
    stage = open_stage(experiment, None, display, number)
    with stage.camera as camera:
        stage.arrange(StageTask("light", "Leave the wall bare."))
        if stage.display is None:
            raise BadInputError("The rig has no screen to show a pattern with.")
        return check_pattern(stage.display, camera, picture)
