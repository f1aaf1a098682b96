"""Other rooms that may explain the images better: one with heat that nobody stated, one under another closure.

They cost a fit each, so they are asked for where the fitted room leaves so much of the images that it is not to be
believed.
"""

from core.estimate.forward_runs import Event, RoomSettings, other_closure
from core.estimate.parameter_fit import Background
from core.estimate.posterior import Analysis, unexplained
from core.estimate.unstated_heat import with_suspected_heat
from core.problem import Problem
from core.room.forward import Room

# Rooms whose closure is right leave 8 to 22 % of the shifts (rms) at 48 cells, those under another 29 to 40, those
# without a heater of theirs 60: it is kept where it takes a fifth off that.
_MUCH, _MOST, HEAT_WORTHWHILE = 0.25, 0.45, 0.8


def left_over(analysis: Analysis) -> float:
    """Share (rms) of the measured shifts that a fitted room leaves."""
    return unexplained(analysis.data, analysis.best.fields)


def suspected_heat(
    analysis: Analysis, background: Background, settings: RoomSettings, report: Event
) -> Problem | None:
    """The problem with heat that nobody stated, where unknown walls do not explain the images and it may; or None."""
    if not settings.use_images or not background.prior.unknown_walls() or left_over(analysis) < _MOST:
        return None
    return with_suspected_heat(background, analysis.data, settings, report)


def promising_closure(analysis: Analysis, coarse: Room) -> str | None:
    """The other closure, where nobody stated one and it may explain the images better than the fitted room; or None.

    So it may where a coarse room under it leaves less of them, and where the fitted one leaves much.
    """
    if analysis.problem.scene.flow.transport != "auto":
        return None
    left = left_over(analysis)
    worth = left > _MUCH or unexplained(analysis.data, analysis.other) < left
    return other_closure(coarse) if worth else None
