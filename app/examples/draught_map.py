"""From captures to a map of draught: reconstruct an experiment, and draw where people would complain.

    airlens demo                    # or an experiment of your own with its captures
    python -m app.examples.draught_map airlens-data/experiments/demo draught.png

Beside the picture lies a table (CSV) of the map: x, y, share of people bothered, and the ends of its 95 % interval.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from app.errors import BadInputError
from app.experiment.folder import finished, open_experiment
from app.pipeline import reconstruct
from app.report.figures import FloorMap, as_png, plans_figure
from app.report.finding import Finding, read_finding
from core.occupied import HEAD_M, at_height


def finding_of(folder: Path) -> Finding:
    """The newest result of an experiment that has one; else its captures are reconstructed."""
    experiment = open_experiment(folder)
    if finished(experiment.results_folder):
        return read_finding(experiment, experiment.latest_result())
    return reconstruct(folder).finding


def draught_map(finding: Finding, picture: Path) -> str:
    """Draw the map at the height of sitting people's heads, write its table, and say where it is worst."""
    solution = finding.solution
    draught = next((one for one in finding.derived if one.name == "draught_rate"), None)
    if draught is None or draught.low is None or draught.high is None:
        raise BadInputError(
            "This result has no velocity with deviations. Reconstruct with the preset standard."
        )
    found, low, high = (
        at_height(np.asarray(part), solution.z_m, HEAD_M)
        for part in (draught.values, draught.low, draught.high)
    )
    plans = [
        FloorMap(title, "%", solution.x_m, solution.y_m, values)
        for title, values in (("people bothered by draught", found), ("at most (95 %)", high))
    ]
    picture.write_bytes(as_png(plans_figure(plans)))
    x, y = np.meshgrid(solution.x_m, solution.y_m, indexing="ij")
    columns = np.stack([part.ravel() for part in (x, y, found, low, high)], axis=1)
    header = "x [m],y [m],draught rate [%],low [%],high [%]"
    np.savetxt(picture.with_suffix(".csv"), columns, fmt="%.4g", delimiter=",", header=header, comments="")
    i, j = np.unravel_index(int(np.argmax(found)), found.shape)
    return (
        f"At head height the draught is worst at x {solution.x_m[i]:.2f}, y {solution.y_m[j]:.2f} m: "
        f"{found[i, j]:.0f} % of people bothered ({low[i, j]:.0f} to {high[i, j]:.0f} %)."
    )


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("experiment", type=Path)
    parser.add_argument("picture", type=Path)
    asked = parser.parse_args()
    sys.stdout.write(draught_map(finding_of(asked.experiment), asked.picture) + "\n")


if __name__ == "__main__":
    main()
