"""Boards before several cameras at once, live on the rig: one place after another, a picture by each camera."""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from app.calibrate.folder import CalibrationFolder, in_a_name
from app.calibrate.pictures import CalibrationStoppedError, Shooter
from app.calibrate.together import add_pictures
from app.errors import AirlensError, BadInputError
from app.experiment.folder import Experiment, open_experiment
from app.experiment.views import own_cameras, view_names
from app.rig.open import open_stage
from app.rig.stage import HeldBoard, Stage, StageTask, board_size_m
from calibration.board import Board
from calibration.common_places import common_places
from calibration.record import SeenBoard
from core.geometry import rotation_vector
from drivers.capture import Abort
from drivers.errors import DeviceError

# Three places fix two cameras; twice as many show one that does not fit.
PLACES = 6


@dataclass(frozen=True)
class TogetherPlan:
    """How to take the pictures: `frames` are averaged into one; so many `places` of the board are asked for."""

    board: Board
    frames: int = 1
    places: int = PLACES


class TogetherSession:
    """The cameras of all views, open. `wanted` says what to arrange; `take` takes the pictures of it.

    `newest` is what the cameras that found the board saw in the pictures that were taken last.
    """

    def __init__(
        self,
        calibration: CalibrationFolder,
        plan: TogetherPlan,
        stages: Mapping[str, Stage],
        skipped: int = 0,
    ) -> None:
        self._calibration, self._plan, self._stages = calibration, plan, dict(stages)
        scene = open_experiment(calibration.experiment).settings.scene
        self._held: list[HeldBoard] = []
        self._skipped = skipped
        self.newest: dict[str, SeenBoard] = {}
        if self.arranges_itself:
            cameras = tuple(view.camera for view in scene.views if view.camera_of is None)
            # More than are wanted: one in which the board is not found is passed over.
            places = common_places(cameras, scene.room, board_size_m(plan.board), 2 * plan.places)
            self._held = [HeldBoard(centre_m, rotation_vector(axes)) for centre_m, axes in places]
            if not self._held:
                raise BadInputError(
                    "No place in the room is seen whole by two cameras. Turn the cameras towards one another's "
                    "view, or take a smaller board."
                )

    @property
    def arranges_itself(self) -> bool:
        """Whether boards are held by a simulated rig."""
        return all(stage.arranges_itself for stage in self._stages.values())

    @property
    def places(self) -> int:
        """How many places two cameras or more have seen."""
        return len(self._calibration.shared().boards)

    def wanted(self) -> StageTask | None:
        """The next thing to arrange; None once there are enough places."""
        number = self._next()
        held = self._held[number] if number < len(self._held) else None
        enough = self.places + self._skipped >= self._plan.places
        if enough or (self.arranges_itself and held is None):
            return None
        text = (
            f"Place {self.places + 1} of {self._plan.places}: hold the board where two cameras or more "
            f"({', '.join(self._stages)}) see it whole, facing halfway between them, elsewhere and tilted otherwise "
            "than before; keep it still."
        )
        return StageTask("shared", text, held=held)

    def skip(self) -> None:
        """Do with one place less."""
        self._skipped += 1

    def retake(self, name: str) -> None:
        """Forget a place and its pictures. Raises BadInputError when there is none of that name."""
        known = [board.name for board in self._calibration.shared().boards]
        folders = self._calibration.live_together.glob("*")
        pictures = [file for one in folders for file in one.iterdir() if file.stem == name]
        if not pictures and name not in known:
            raise BadInputError(f"There is no place {name!r}; known are: {', '.join(known) or 'none'}.")
        self._calibration.change_shared(lambda record: record.without(name))
        for picture in pictures:
            picture.unlink(missing_ok=True)

    def take(self, abort: Abort | None = None) -> tuple[str, ...]:
        """A picture by each camera at the same time; returns what is wrong with them.

        A camera that fails is named; where two others took theirs, these count. Raises CalibrationStoppedError,
        AirlensError; pictures taken before that are kept.
        """
        task = self.wanted()
        if task is None:
            return ()
        for stage in self._stages.values():
            stage.arrange(task)
        name, folder = f"place_{self._next():02d}", self._calibration.live_together
        with ThreadPoolExecutor(len(self._stages), "together") as threads:
            under_way = [
                threads.submit(
                    Shooter(stage, self._plan.frames, 0.0, lambda done, total: None, abort).one,
                    folder / in_a_name(view) / f"{name}.png",
                )
                for view, stage in self._stages.items()
            ]
        failed = []
        for view, one in zip(self._stages, under_way, strict=True):
            try:
                one.result()
            except CalibrationStoppedError:
                raise
            except (AirlensError, DeviceError) as error:
                failed.append(f"The camera of {view!r}: {error}")
        if len(self._stages) - len(failed) < 2:
            raise AirlensError(f"{' '.join(failed)} This place counts for nothing; take it again.")
        return (*failed, *self._used(folder, name))

    def resume(self) -> tuple[str, ...]:
        """Use pictures that an earlier session took and did not come to use."""
        folder, known = self._calibration.live_together, {b.name for b in self._calibration.shared().boards}
        left = sorted({path.stem for path in folder.glob("*/place_*")} - known)
        return tuple(issue for name in left for issue in self._used(folder, name))

    def _used(self, folder: Path, name: str) -> tuple[str, ...]:
        full_scale = min(2**stage.camera.info.bits - 1 for stage in self._stages.values())
        added = add_pictures(
            self._calibration, folder, self._plan.board, full_scale, lambda told: None, f"{name}.*"
        )
        self.newest = added.seen.get(name, {})
        return added.issues

    def _next(self) -> int:
        """One more than the largest number of a place that was pictured."""
        taken = self._calibration.live_together.glob("*/place_*")
        numbers = [int(path.stem.removeprefix("place_")) for path in taken if path.stem[6:].isdigit()]
        return 1 + max(numbers, default=-1)


@contextmanager
def opened(experiment: Experiment, board: Board) -> Iterator[dict[str, Stage]]:
    """The stages of all views that have a camera, by name, with open cameras. Raises BadInputError, DeviceError."""
    with ExitStack() as stack:
        stages = {}
        for number in own_cameras(experiment):
            stage = open_stage(experiment, board, None, number)
            stack.enter_context(stage.camera)
            stages[view_names(experiment)[number]] = stage
        yield stages
