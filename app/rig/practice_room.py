"""What a simulated camera sees while its rig is calibrated: a wall, a board held where the guide asks, light."""

import numpy as np
from jaxtyping import Float32

from app.rig.stage import HeldBoard, StageTask, board_size_m
from calibration.board import Board
from calibration.guide import WantedView, pose_of
from calibration.simulated_pictures import Look, Sheet, look
from core.geometry import Optics, rotation_matrix
from core.scene import ProjectedPattern, Scene
from core.view_frame import Turn
from drivers.display import Picture

# World axes of a sheet that faces the camera: x to the right, y down, normal away from it.
FACING = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
PAINT_PX_PER_SQUARE = 40
WALL_ALBEDO = 0.8
# Room light while boards are shown without a projector, and what is left of it beside one.
ROOM_LIGHT = 0.85
STRAY_LIGHT = 0.02
PROJECTOR_LIGHT = 0.85
# A board is held before the wall, also where it would have to be further away to look small enough.
NEAREST_TO_WALL = 0.85


class PracticeRoom:
    """Callable as a camera's view. `show` is the projector's panel; `arrange` moves board and lens cap.

    The scene is in the view's own frame; `turn` leads there from the room, in which several cameras see one board.
    """

    def __init__(self, scene: Scene, view: int, board: Board | None, turn: Turn | None = None) -> None:
        self._turn = np.eye(3) if turn is None else turn.matrix
        self._camera: Optics = scene.views[view].camera
        light = scene.light
        self._projector = light.projector if isinstance(light, ProjectedPattern) else None
        self._wall_y_m = scene.room.upper_m[1]
        self._board = board
        self._picture: Picture | None = None
        self._covered, self._by_room = False, False
        self._look: Look | None = None
        self._seen: Float32[np.ndarray, "rows cols"] | None = None
        self.arrange(StageTask("light", ""))

    def arrange(self, task: StageTask) -> None:
        """Do what the task says, as a careful operator would."""
        sheets = [self._wall()]
        if self._board is not None and task.kind in ("board", "place") and task.view is not None:
            sheets.append(self._held(task.view, self._board))
        if self._board is not None and task.held is not None:
            sheets.append(_printed(self._board, *_placed(task.held, self._turn)))
        if self._board is not None and task.kind == "level":
            sheets.insert(0, self._on_wall(self._board))
        self._covered = task.kind == "dark"
        self._by_room = self._projector is None or task.kind in ("board", "shared", "level")
        self._look = look(self._camera, tuple(sheets), self._projector)
        self._seen = None

    def show(self, picture: Picture) -> None:
        """Light the room with this picture from now on."""
        self._picture, self._seen = picture, None

    def __call__(self) -> Float32[np.ndarray, "rows cols"]:
        """Luminance; the same array until something changes."""
        if self._seen is None:
            self._seen = self._expose()
        return self._seen

    def _expose(self) -> Float32[np.ndarray, "rows cols"]:
        if self._look is None or self._covered:
            return np.zeros((self._camera.height_px, self._camera.width_px), np.float32)
        if self._by_room or self._picture is None:
            return self._look.expose(None, ROOM_LIGHT if self._by_room else STRAY_LIGHT)
        return self._look.expose(self._picture.astype(np.float32) * (PROJECTOR_LIGHT / 255), STRAY_LIGHT)

    def _wall(self) -> Sheet:
        paint = np.full((4, 4), WALL_ALBEDO, np.float32)
        return Sheet(paint, 1.0, np.array([0.0, self._wall_y_m, 0.0]), FACING, WALL_ALBEDO)

    def _held(self, wanted: WantedView, board: Board) -> Sheet:
        width_m, height_m = board_size_m(board)
        rotation, centre_m = pose_of(wanted, self._camera, (float(width_m), float(height_m)))
        world_from_camera = self._camera.rotation.T
        towards = world_from_camera @ centre_m
        reach_m = NEAREST_TO_WALL * (self._wall_y_m - self._camera.position_m[1])
        towards = towards * min(1.0, reach_m / towards[1])
        return _printed(board, np.array(self._camera.position_m) + towards, world_from_camera @ rotation)

    def _on_wall(self, board: Board) -> Sheet:
        """Level and flat on the wall where the camera's middle pixel looks, a hair before it."""
        towards = self._camera.rotation.T @ np.array([0.0, 0.0, 1.0])
        origin = np.array(self._camera.position_m)
        centre_m = origin + towards * (self._wall_y_m - origin[1]) / towards[1]
        return _printed(board, centre_m - np.array([0.0, 1e-6, 0.0]), FACING)


def _placed(held: HeldBoard, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre and axes of a board of the room in the view's frame."""
    return turn @ np.array(held.centre_m), turn @ rotation_matrix(held.rotation_rad)


def _printed(board: Board, centre_m: np.ndarray, world_from_sheet: np.ndarray) -> Sheet:
    paint = board.draw(PAINT_PX_PER_SQUARE)
    px_per_m = PAINT_PX_PER_SQUARE / board.pitch_m
    size_m = np.array(paint.shape[::-1]) / px_per_m
    corner_m = centre_m - world_from_sheet[:, :2] @ (size_m / 2)
    return Sheet(paint, px_per_m, corner_m, world_from_sheet)
