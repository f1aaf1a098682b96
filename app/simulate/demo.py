"""`demo`: simulate a lab's rig before the packaged room, capture, reconstruct, report: the program's best."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from app.errors import BadInputError
from app.pipeline import reconstruct
from app.report.answer import summary
from app.report.beside import Place, places
from app.simulate.experiment import simulate
from app.simulate.worlds import LAB
from app.volume.scene import RigOptions
from app.volume.score import coverage
from core.result import Solution
from core.watch import Growing, Watch

_MARK = ".airlens-demo"
# A lab's pictures from the paper's place, with a printed frame where no air moves, as README tells everybody to hang.
WORLD = replace(LAB, border="print", place="paper")


@dataclass(frozen=True)
class Size:
    """What a laptop can afford: the camera's width, frames a capture, and cells along the room."""

    camera_px: int = 1536
    frames: int = 50
    cells: int = 32


@dataclass(frozen=True)
class Story:
    """What the demo has to say: sentences, what was found at a few places, how wrong it is, and where it is.

    `velocity_error` is over the rms of the true velocity; `held` are the shares of places whose truth lies in the
    95 % intervals of T and u.
    """

    sentences: tuple[str, ...]
    places: tuple[Place, ...]
    temperature_error_k: float
    velocity_error: float
    held: tuple[float, float]
    solution: Solution
    result: Path

    @property
    def report(self) -> Path:
        """The report's file."""
        return self.result / "report.html"


def run_demo(
    folder: Path,
    room: Path,
    size: Size = Size(),
    on_stage: Callable[[str, float | None, Growing | None], object] = lambda stage, share, growing: None,
) -> Story:
    """Run the whole chain in `folder`. Raises BadInputError when that holds something other than a demo."""
    if folder.exists() and any(folder.iterdir()):
        if not (folder / _MARK).exists():
            raise BadInputError(f"{folder} is not empty and not a demo; give another folder.")
        shutil.rmtree(folder)
    options = RigOptions(camera_px=(size.camera_px, size.camera_px * 3 // 4), frames=size.frames)
    on_stage("compute the light's way through the room", None, None)
    simulate(
        room,
        folder,
        options,
        "surveyed",
        WORLD.camera(seed=0),
        lambda role, done, total: on_stage(
            f"take the {role} pictures: {done} of {total}", done / total, None
        ),
        misreads=WORLD.misreads,
        cells=size.cells,
    )
    (folder / _MARK).touch()

    def told(row, growing: Growing | None) -> None:
        share = row.get("share")
        on_stage(str(row["doing"]), share if isinstance(share, float) else None, growing)

    done = reconstruct(folder, "standard", watch=Watch(told))
    finding, truth = done.finding, done.finding.truth
    if truth is None or finding.scores is None:
        raise BadInputError(f"{folder} has lost its truth while the demo ran; run it again.")
    held = coverage(done.solution, truth)
    return Story(
        summary(finding),
        places(done.solution, finding.experiment.settings.scene, truth),
        finding.scores["T"]["rms_K"],
        finding.scores["u"]["rel"],
        (held["T_within"] or 0.0, held["u_within"] or 0.0),
        done.solution,
        done.folder,
    )
