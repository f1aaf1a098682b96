"""A guided calibration of a rig: asks for one thing after another, takes its pictures, says how good it is.

Every picture is kept on disk as soon as it is taken and every result as soon as it is known, so that a
session that was stopped, or killed, goes on where it was. Steps: camera -> projector -> wall; response.
"""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.pictures import OnPicture, Shooter
from app.calibrate.response import calibrate_response
from app.calibrate.steps import (
    Pictures,
    StepOutcome,
    built,
    calibrate_camera,
    calibrate_projector,
    calibrate_wall,
    modelled,
    put_to_use,
)
from app.calibrate.whose import check_own
from app.errors import AirlensError, BadInputError
from app.rig.stage import Stage, StageTask, TaskKind
from calibration.board import Board
from calibration.graycode import frame_count
from calibration.guide import CAMERA_PLAN, PROJECTOR_PLAN, WantedView, unmet
from calibration.record import Placement, Record, SeenBoard
from core.geometry import WallName
from drivers.capture import Abort
from drivers.settings import held

# Exposures are whole multiples of the one in use, so that a projector's periods stay whole.
EXPOSURE_FACTORS = (1, 2, 3, 4)
EXPOSURE_PARTS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)
GREY_LEVELS = (0, 32, 64, 96, 128, 160, 192, 224, 255)
# The light whose fourfold exposure does not yet saturate.
_FOURFOLD_SAFE = 0.2

_UNPLACED = Placement()


@dataclass(frozen=True)
class LivePlan:
    """How to take pictures. `frames` are averaged into one; `settle_s` is waited after each new pattern."""

    step: StepName
    camera: str = "camera"
    board: Board | None = None
    frames: int = 1
    response_frames: int = 8
    settle_s: float = 0.0
    placement: Placement = _UNPLACED


class GuidedCalibration:
    """One step of one rig's calibration. `wanted` says what to arrange; `take` takes the pictures of it."""

    def __init__(
        self,
        calibration: CalibrationFolder,
        plan: LivePlan,
        stage: Stage,
        skipped: tuple[StageTask, ...] = (),
    ) -> None:
        self._calibration, self._plan, self._stage = calibration, plan, stage
        self.skipped = skipped
        self._folder = calibration.live(plan.step, plan.camera)
        self.issues: tuple[str, ...] = ()
        self._check()

    @property
    def record(self) -> Record | None:
        """What was seen so far."""
        return self._calibration.collected(self._plan.camera)

    def wanted(self) -> StageTask | None:
        """The next thing to arrange; None when the plan is done."""
        return next((task for task in self._tasks() if task not in self.skipped), None)

    def skip(self) -> None:
        """Do without what is wanted now, until the session is started anew."""
        task = self.wanted()
        if task is not None:
            self.skipped = (*self.skipped, task)

    def resume(self) -> None:
        """Use pictures that an earlier session took and did not come to use; remove half a sequence."""
        record = self.record
        known = set() if record is None else {b.name.split("/")[0] for b in record.boards}
        if self._plan.step is StepName.camera:
            for file in sorted(self._folder.glob("view_*")):
                if file.name not in known:
                    self._used(lambda name=file.name: self._camera(name))
        if self._plan.step is StepName.projector and self._stage.panel_px is not None:
            for place in sorted(self._folder.glob("place_*")):
                if len(list(place.glob("graycode_*"))) < frame_count(*self._stage.panel_px):
                    shutil.rmtree(place)
                elif place.name not in known:
                    self._used(lambda name=place.name: self._projector(name))

    def take(
        self, progress: OnPicture = lambda done, total: None, abort: Abort | None = None
    ) -> tuple[str, ...]:
        """Take the pictures of what is wanted, use them, and return what is wrong with them.

        Raises CalibrationStoppedError, AirlensError, DeviceError; pictures taken before that are kept.
        """
        task = self.wanted()
        if task is None:
            return ()
        self._stage.arrange(task)
        shooter = Shooter(self._stage, self._plan.frames, self._plan.settle_s, progress, abort)
        return {
            StepName.camera: self._take_camera,
            StepName.projector: self._take_projector,
            StepName.wall: self._take_wall,
            StepName.response: self._take_response,
        }[self._plan.step](task, shooter)

    def retake(self, name: str) -> StepOutcome | None:
        """Forget a view and its pictures. Raises BadInputError when there is none of that name."""
        record = self.record
        boards = () if record is None else record.boards
        gone = [b for b in boards if b.name.split("/")[0] == name]
        path = self._folder / name
        if not gone and not path.exists():
            known = ", ".join(sorted({b.name.split("/")[0] for b in boards})) or "none"
            raise BadInputError(f"There is no view {name!r}; known are: {known}.")
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        if record is None:
            return None
        left = replace(record, boards=tuple(b for b in boards if b not in gone))
        return built(self._calibration, self._plan.step, left, [])

    def finish(self) -> bool:
        """Put to use what the step has collected, once nothing more is wanted. Return whether it is in use."""
        if self.wanted() is not None:
            return False
        record, step = self.record, self._plan.step
        if record is None or self._calibration.started(self._plan.camera) is not step:
            return True
        return put_to_use(self._calibration, modelled(self._calibration, step, record, [])).model is not None

    def _check(self) -> None:
        step, plan = self._plan.step, self._plan
        check_own(self._calibration, plan.camera, step)
        record, other = self.record, self._calibration.started(plan.camera)
        if plan.board is None and self._needs_board(record):
            raise BadInputError(
                "The board is not known. State it under Board on the page, by --grid and --square, or as "
                "a [rig.board] table in experiment.toml."
            )
        if other not in (None, step) and step is not StepName.response:
            raise BadInputError(
                f"The step '{other}' is started and not complete: take or skip what it still asks for, or "
                "discard it. Until then the calibration in use stays as it was."
            )
        if step is StepName.projector and self._stage.display is None:
            raise BadInputError("This rig has no projector: its scene is lit otherwise.")
        if step is StepName.wall and record is None:
            raise BadInputError("There is no calibrated camera yet; take the step 'camera' first.")
        lit = record is not None and record.panel_size_px is not None
        if step is StepName.wall and self._stage.display is not None and not lit:
            raise BadInputError("Gray code on the wall needs a calibrated projector; calibrate that first.")

    def _needs_board(self, record: Record | None) -> bool:
        """Whether the step can only be taken with a board; a wall is found by one where nothing shows Gray code."""
        if self._plan.step is StepName.wall:
            return self._stage.display is None and record is not None and record.level is None
        return self._plan.step is not StepName.response

    def _tasks(self) -> list[StageTask]:
        return {
            StepName.camera: self._camera_tasks,
            StepName.projector: self._projector_tasks,
            StepName.wall: self._wall_tasks,
            StepName.response: self._response_tasks,
        }[self._plan.step]()

    def _camera_tasks(self) -> list[StageTask]:
        return _board_tasks("board", CAMERA_PLAN, self.record, lambda board: True)

    def _projector_tasks(self) -> list[StageTask]:
        return _board_tasks("place", PROJECTOR_PLAN, self.record, lambda board: bool(board.panel_px))

    def _wall_tasks(self) -> list[StageTask]:
        record, tasks = self.record, []
        if self._stage.display is not None and not self._whole_wall():
            tasks.append(StageTask("wall", "Leave the wall bare and the room dark; nobody in the picture."))
        levelled = self._plan.placement.plumb_px or (record is not None and record.level is not None)
        if self._plan.board is not None and not levelled:
            tasks.append(
                StageTask(
                    "level",
                    f"Light the room; hold the board flat {_held(self._plan.placement.wall)}, in the "
                    "picture's middle.",
                )
            )
        return tasks

    def _response_tasks(self) -> list[StageTask]:
        tasks = []
        if not self._has_burst("dark"):
            tasks.append(StageTask("dark", "Cover the lens."))
        whole = [n for n in self._response_names() if self._has_burst(n)]
        if len(whole) < len(self._response_names()):
            tasks.append(
                StageTask("light", "Uncover the lens; steady light on the bare wall, nobody in the picture.")
            )
        return tasks

    def _response_names(self) -> list[str]:
        """Bursts of steady light, those that exist and those to come."""
        exposures = [p.name for p in self._folder.glob("exposure_*")]
        wanted = len(EXPOSURE_FACTORS if self._stage.display else EXPOSURE_PARTS)
        exposures += ["exposure"] * (wanted - len(exposures))
        return exposures + [f"grey_{g}" for g in (GREY_LEVELS if self._stage.display else ())]

    def _has_burst(self, name: str) -> bool:
        return len(list((self._folder / name).glob("*.png"))) >= self._plan.response_frames

    def _whole_wall(self) -> bool:
        panel = self._stage.panel_px
        return panel is not None and len(list(self._folder.glob("graycode_*"))) == frame_count(*panel)

    def _take_camera(self, task: StageTask, shooter: Shooter) -> tuple[str, ...]:
        file = shooter.one(self._folder / f"view_{_next(self._folder, 'view_'):02d}.png")
        return self._used(lambda: self._camera(file.name))

    def _take_projector(self, task: StageTask, shooter: Shooter) -> tuple[str, ...]:
        name = f"place_{_next(self._folder, 'place_'):02d}"
        shooter.gray_code(self._folder / name)
        return self._used(lambda: self._projector(name))

    def _take_wall(self, task: StageTask, shooter: Shooter) -> tuple[str, ...]:
        level = self._calibration.live("level", self._plan.camera) / "level.png"
        if task.kind == "wall":
            shooter.gray_code(self._folder)
        else:
            level = shooter.one(level)
        return self._used(lambda: self._wall(level if task.kind == "level" else None))

    def _take_response(self, task: StageTask, shooter: Shooter) -> tuple[str, ...]:
        frames = self._plan.response_frames
        if task.kind == "dark":
            shooter.burst(self._folder / "dark", frames, dark=True)
            return ()
        levels = {}
        if self._stage.display is not None:
            for grey in GREY_LEVELS:
                shooter.light(grey)
                levels[grey] = shooter.burst(self._folder / f"grey_{grey}", frames)
            shooter.light(max((g for g in levels if levels[g] < _FOURFOLD_SAFE), default=GREY_LEVELS[1]))
        self._exposures(shooter, frames)
        bits = self._stage.camera.info.bits
        calibrate_response(self._calibration, self._plan.camera, self._folder, bits)
        return ()

    def _exposures(self, shooter: Shooter, frames: int) -> None:
        """Bursts at several exposure times under one light."""
        camera = self._stage.camera
        own_s = camera.exposure_s
        if own_s is None:
            return
        for factor in EXPOSURE_FACTORS if self._stage.display else EXPOSURE_PARTS:
            with held(camera, own_s * factor) as (exposure, _):
                shooter.burst(self._folder / f"exposure_{exposure.granted:.6g}", frames)

    def _camera(self, name: str) -> StepOutcome:
        pictures = Pictures(self._folder, name, self._full_scale())
        return calibrate_camera(self._calibration, self._plan.camera, pictures, self._board(), _quiet)

    def _projector(self, name: str) -> StepOutcome:
        pictures = Pictures(self._folder, f"{name}/*", self._full_scale())
        panel = self._stage.panel_px or (0, 0)
        return calibrate_projector(
            self._calibration, self._plan.camera, pictures, self._board(), panel, _quiet
        )

    def _wall(self, level: Path | None) -> StepOutcome:
        bare = Pictures(self._folder, "graycode_*", self._full_scale()) if self._whole_wall() else None
        shown = None if level is None else (level, self._board())
        return calibrate_wall(self._calibration, self._plan.camera, bare, shown, self._plan.placement, _quiet)

    def _used(self, step: Callable[[], StepOutcome]) -> tuple[str, ...]:
        """What is wrong with the newest pictures; too few views yet is no fault of theirs."""
        try:
            self.issues = step().issues
        except BadInputError as error:
            self.issues = (str(error),)
        return self.issues

    def _board(self) -> Board:
        if self._plan.board is None:
            raise AirlensError("The board is not known.")
        return self._plan.board

    def _full_scale(self) -> int:
        return 2**self._stage.camera.info.bits - 1


def _board_tasks(
    kind: TaskKind, plan: tuple[WantedView, ...], record: Record | None, counts: Callable[[SeenBoard], bool]
) -> list[StageTask]:
    boards = () if record is None else tuple(b for b in record.boards if counts(b))
    left = list(plan) if record is None else unmet(plan, boards, record.camera_size_px)
    return [StageTask(kind, view.text, view) for view in left]


def _held(wall: WallName) -> str:
    """How a board is held level; on a ceiling or floor nothing is level, and the room's axes tell."""
    flat = {
        "z_max": "against the ceiling, its upper edge towards y_min",
        "z_min": "on the floor, its upper edge towards y_max",
    }
    return flat.get(wall, "against the wall, level")


def _next(folder: Path, stem: str) -> int:
    """One more than the largest number in use."""
    used = [p.stem.removeprefix(stem) for p in folder.glob(f"{stem}*")]
    return 1 + max((int(text) for text in used if text.isdigit()), default=-1)


def _quiet(name: str) -> None:
    """Progress of reading is not told: the pictures were just taken."""
