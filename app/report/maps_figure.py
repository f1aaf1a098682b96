"""Maps seen from above at the height of sitting people's heads: draught with its upper end, PMV, age of the air."""

import numpy as np
from matplotlib.figure import Figure

from app.report.figures import FloorMap, plans_figure
from app.report.finding import Finding
from core.occupied import HEAD_M, at_height
from core.setting import SettingError

# Name, title, unit, and which of its volumes.
_SHOWN = (
    ("draught_rate", "people bothered by draught", "%", "values"),
    ("draught_rate", "draught: upper end of 95 %", "%", "high"),
    ("age", "age of the air", "min", "values"),
)


def maps_figure(finding: Finding) -> Figure:
    """The maps of a result, side by side. Raises SettingError for one without velocity."""
    kept = {one.name: one for one in finding.derived}
    if not kept:
        raise SettingError(
            "This result has no velocity: there is no map of draught. Reconstruct with standard."
        )
    solution, plans = finding.solution, []
    for name, title, unit, part in _SHOWN:
        values = getattr(kept[name], part) if name in kept else None
        if values is not None:
            plane = at_height(np.asarray(values, np.float64), solution.z_m, HEAD_M)
            plans.append(FloorMap(title, unit, solution.x_m, solution.y_m, plane, "gouraud"))
    return plans_figure(plans)
