"""Projectors that light one wall in turn: all are dark but that of the view whose turn it is.

Each shows its own pattern all the time; dark is its own "mute", which blanks the picture and leaves the lamp.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext

from app.errors import AirlensError
from app.experiment.folder import Experiment
from app.experiment.views import lamp_number, view_names
from app.rig.live_projectors import LiveProjectors
from app.rig.open import open_projector
from drivers.projector.protocol import Projector

# Opens the projector of a view, by its number.
OpensProjector = Callable[[int], AbstractContextManager[Projector]]


class Lamps:
    """The projectors of one experiment; `opens` speaks to them, by default each on a line of its own."""

    def __init__(self, experiment: Experiment, opens: OpensProjector | None = None) -> None:
        self._experiment = experiment
        self._opens = opens or (lambda view: closing(open_projector(experiment, view)))

    def light(self, view: int) -> None:
        """Let the view's projector alone light its wall; nothing where no camera sees several in turn there.

        A simulated rig lights each picture as its view states. Raises BadInputError for a projector that the rig does
        not name, AirlensError for one that does not do as it is told, DeviceError.
        """
        if self._experiment.settings.rig.camera_kind == "simulated":
            return
        views = self._experiment.settings.scene.views
        same_wall = [n for n, one in enumerate(views) if one.wall == views[view].wall]
        if not any(views[n].camera_of for n in same_wall):
            return
        lamp = lamp_number(self._experiment, view)
        for other in {lamp_number(self._experiment, n) for n in same_wall} - {lamp}:
            self._mute(other, True)
        self._mute(lamp, False)

    def _mute(self, number: int, dark: bool) -> None:
        name = view_names(self._experiment)[number]
        with self._opens(number) as projector:
            projector.mute(dark)
            muted = projector.status().muted
        if muted is not dark:
            said = {True: "it is dark", False: "it shows its picture", None: "it does not tell"}[muted]
            raise AirlensError(
                f"The projector of {name!r} was told to {'be dark' if dark else 'show its picture'}, and {said}. One "
                "camera sees several projectors in turn, so each must be on and know mute. Check it: airlens "
                "projector status ADDRESS."
            )


def lamps_beside(experiment: Experiment, live: LiveProjectors | None) -> Lamps:
    """The projectors, where a service itself may hold the lines of some."""

    def opens(view: int) -> AbstractContextManager[Projector]:
        found = None if live is None else live.held(experiment.folder.name, view)
        return closing(open_projector(experiment, view)) if found is None else nullcontext(found)

    return Lamps(experiment, opens)
