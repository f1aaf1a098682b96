"""Model selection: is another closure, or a heat source that nobody stated, a better explanation of the images?

Each alternative costs a whole fit. It is tried only where the fitted room leaves much of the images unexplained: for
a heat source, more than half, or than models of the air differ in (`core.estimate.model_error`). Heat is tried too
where an entry, or another parameter, had to move further than it may.
"""

import numpy as np
from scipy.stats import chi2

from core.estimate.diagnostics import missing, moved_too_far
from core.estimate.explained import explained
from core.estimate.forward_runs import RoomSettings, other_closure
from core.estimate.marches import Marches
from core.estimate.parameter_fit import Background
from core.estimate.posterior import Analysis, model_error_of
from core.estimate.unstated_heat import Suspect, independent, is_placed, likeliest
from core.room.forward import LARGE_EDDIES, Room
from core.significance import FALSE_ALARMS
from core.view_frame import told_on_floor

# Share of the measured shifts (rms) that a fitted room leaves unexplained. At 48 cells rooms with the right closure
# leave 8 to 22 %, rooms with a wrong one 29 to 40 %.
_TRY_CLOSURE = 0.25


def left_over(analysis: Analysis) -> float:
    """Share (rms) of the measured shifts that a fitted room leaves unexplained."""
    return explained(analysis.data, analysis.best.fields).share_left


def worth_naming(suspect: Suspect, analysis: Analysis) -> bool:
    """Whether heat that a fit could not use is named: the room lacks something, and images tell a place for it."""
    lacks = missing(explained(analysis.data, analysis.best.fields), model_error_of(analysis))
    return lacks and is_placed(suspect, analysis.problem)


def suspected_heat(
    analysis: Analysis, background: Background, settings: RoomSettings, marches: Marches
) -> Suspect | None:
    """The panel of floor whose heat may be missing; None where nothing is, or no panel would explain anything.

    It is looked for where the fitted room lacks something, and where the fit moved a parameter too far, such as an
    entry: none is accused before a source that nobody stated has been tried in its place.
    """
    if not settings.use_images:
        return None
    error = model_error_of(analysis)
    lacks = missing(explained(analysis.data, analysis.best.fields), error)
    if not lacks and not moved_too_far(analysis.prior, analysis.posterior, error.moves):
        return None
    return likeliest(background, analysis.data, settings, marches)


def explains_more(one: Analysis, other: Analysis) -> bool:
    """Whether `one` explains more of the images than `other` beyond chance; one has suspected heat, one has not.

    Chance passes once in twenty. Twice the logarithm of the likelihoods' ratio, of the images' data that err by
    themselves, has a chi-square distribution (Wilks 1938). Its degrees of freedom are the heat of the panel and of
    its neighbours.
    """
    gained = 2.0 * independent(other.data) * np.log(left_over(other) / left_over(one))
    panels = 1 + 2 * len(told_on_floor(other.problem.scene))
    return bool(gained > chi2.ppf(1.0 - FALSE_ALARMS, panels))


def worth_large_eddies(analysis: Analysis, settings: RoomSettings) -> bool:
    """Whether the room should be fitted with its large eddies marched too: closures leave much, or it is stated."""
    if not settings.use_images:
        return False
    if stated_eddies(analysis):
        return True
    return analysis.problem.scene.flow.transport == "auto" and left_over(analysis) > _TRY_CLOSURE


def stated_eddies(analysis: Analysis) -> bool:
    """Whether the scene states that large eddies are to be marched."""
    return analysis.problem.scene.flow.transport == LARGE_EDDIES


def promising_closure(analysis: Analysis, coarse: Room) -> str | None:
    """The other closure if it should be fitted as well; None if not, or if the scene states the closure.

    It should if the fitted room leaves much of the images unexplained, or more of them than a coarse room
    under the other closure does.
    """
    if analysis.problem.scene.flow.transport != "auto":
        return None
    left = left_over(analysis)
    worth = left > _TRY_CLOSURE or explained(analysis.data, analysis.other).share_left < left
    return other_closure(coarse) if worth else None
