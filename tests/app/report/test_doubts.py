"""What a reader must not miss is picked from all that a result says of itself."""

from app.report.doubts import checks, doubts
from core.estimate.diagnostics import doubtful, missing_heat, other_way, suspicion
from core.room.boundary_conditions import SuspectedHeater
from core.scene import Patch
from tests.core.estimate.test_temperature_levels import problem

FLOOR = Patch(wall="z_min", lower_m=(0.8, 0.8), upper_m=(1.2, 1.2))


def test_what_bids_distrust_is_picked_from_all_that_a_result_says_the_most_telling_first():
    said = (*doubtful(0.2), *doubtful(0.7), *other_way(0.1), *other_way(-0.8), "No still border was found.")
    assert doubts(said) == (*other_way(-0.8), *doubtful(0.7))


def test_what_is_to_be_looked_at_comes_from_what_the_fit_says_heat_before_entries():
    given, panel = problem(stated=True), SuspectedHeater(patch=FLOOR, temperature_k=293.15)
    heat, gone = suspicion(given, panel, 40.0), missing_heat(given, panel, 0.8)
    entry = "The measurements say that inlet 1 on x_min supplies 0.84 times the velocity entered. Check it."
    level = "A source, a leak or a wall is not as stated."
    said = (level, entry, *doubtful(0.7), *doubtful(0.2), *heat, gone, "No still border was found.")

    assert heat
    assert checks(said) == (*heat, gone, entry, level)
