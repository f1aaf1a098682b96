"""Maps seen from above at the height of sitting people's heads: draught with its upper end, PMV, age of the air."""

import numpy as np
from matplotlib.figure import Figure

from app.report.figures import DIVERGING, SEQUENTIAL, FloorMap, plans_figure
from app.report.finding import Finding
from app.report.meaning import DRAUGHT_LIMITS, PMV_LIMITS
from core.occupied import HEAD_M, OccupiedZone, at_height
from core.setting import SettingError

# Draught and PMV have fixed scales, marked where the categories of ISO 7730 end: one colour means one category.
_DRAUGHT_ENDS, _PMV_ENDS = (0.0, 40.0), (-1.0, 1.0)
_DRAUGHT_MARKS = (
    (0.0, "0"),
    *((limit, f"{limit:g} {letter}") for limit, letter in zip(DRAUGHT_LIMITS, "ABC", strict=True)),
    (40.0, "40"),
)
_PMV_MARKS = tuple(
    (value, f"{value:g}{' B' if abs(value) == PMV_LIMITS[1] else ''}")
    for value in (-1.0, -PMV_LIMITS[1], 0.0, PMV_LIMITS[1], 1.0)
)


def maps_figure(finding: Finding) -> Figure:
    """The maps of a result, side by side. Raises SettingError for one without velocity, or without a zone."""
    kept = {one.name: one for one in finding.derived}
    if not kept:
        raise SettingError(
            "This result has no velocity: there is no map of draught. Reconstruct with standard."
        )
    draught, vote = kept["draught_rate"], kept["pmv"]
    shown = [
        ("draught", "people bothered [%]", draught.values, _DRAUGHT_ENDS, SEQUENTIAL, _DRAUGHT_MARKS),
        (
            "draught, upper end of 95 %",
            "people bothered [%]",
            draught.high,
            _DRAUGHT_ENDS,
            SEQUENTIAL,
            _DRAUGHT_MARKS,
        ),
        ("warmth", "predicted mean vote (PMV)", vote.values, _PMV_ENDS, DIVERGING, _PMV_MARKS),
    ]
    if "age" in kept:
        shown.append(("age of the air", "min", kept["age"].values, None, SEQUENTIAL, ()))
    solution = finding.solution
    plans = []
    for title, label, values, ends, colours, marks in shown:
        if values is not None:
            plane = at_height(np.asarray(values, np.float64), solution.z_m, HEAD_M)
            plans.append(FloorMap(title, label, solution.x_m, solution.y_m, plane, ends, colours, marks))
    return plans_figure(plans, OccupiedZone().box(finding.experiment.settings.scene.room))
