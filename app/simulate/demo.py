"""`demo`: simulate a rig before the packaged room, capture, reconstruct, report; three sentences at the end."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.errors import BadInputError
from app.experiment.rig_settings import SimulatedCameraSettings
from app.pipeline import reconstruct
from app.report.page import summary
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions
from core.watch import Watch

_MARK = ".airlens-demo"


@dataclass(frozen=True)
class Story:
    """What the demo has to say, and where its report is."""

    sentences: tuple[str, ...]
    report: Path


def run_demo(
    folder: Path, room: Path, camera_px: int, frames: int, on_stage: Callable[[str], object]
) -> Story:
    """Run the whole chain in `folder`. Raises BadInputError when that holds something other than a demo."""
    if folder.exists() and any(folder.iterdir()):
        if not (folder / _MARK).exists():
            raise BadInputError(f"{folder} is not empty and not a demo; give another folder.")
        shutil.rmtree(folder)
    options = RigOptions(camera_px=(camera_px, camera_px * 3 // 4), frames=frames)
    on_stage("simulate the rig and render the room")
    simulate(
        room,
        folder,
        options,
        "surveyed",
        SimulatedCameraSettings(drift_px=0.1),
        lambda role, done, total: on_stage(f"{role} capture: frame {done} of {total}"),
    )
    (folder / _MARK).touch()
    watch = Watch(lambda row, growing: on_stage(str(row["doing"])))
    done = reconstruct(folder, "draft", watch=watch)
    return Story(summary(done.finding), done.folder / "report.html")
