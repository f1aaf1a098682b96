"""Which devices make up the rig: the `[rig]` table of experiment.toml."""

from typing import Annotated, Literal

from pydantic import Field

from app.errors import BadInputError
from app.files.toml import Strict
from calibration.board import Board, CharucoBoard, Chessboard, CircleGrid
from calibration.errors import CalibrationError


class SimulatedCameraSettings(Strict):
    """A camera twin that looks at a room volume in the experiment folder."""

    kind: Literal["simulated"] = "simulated"
    room: str = "truth.npz"
    exposure_s: Annotated[float, Field(gt=0, le=60)] = 0.02
    seed: int = 0
    drift_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    noise_free: bool = False


class V4l2CameraSettings(Strict):
    """A camera that the kernel knows (Video for Linux).

    `frame_rate_hz` is the camera's own unless given; automatic exposure, gain, white balance and focus are
    switched off unless `automatics_off` is false.
    """

    kind: Literal["v4l2"]
    device: str = "/dev/video0"
    pixel_format: str = "Y16"
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    bits: Annotated[int, Field(ge=1, le=16)] = 16
    exposure_s: Annotated[float, Field(gt=0, le=60)]
    gain: float | None = None
    frame_rate_hz: Annotated[float | None, Field(gt=0, le=10_000)] = None
    automatics_off: bool = True


CameraSettings = Annotated[SimulatedCameraSettings | V4l2CameraSettings, Field(discriminator="kind")]


class BoardSettings(Strict):
    """The board that the rig is calibrated with: inner corners (chessboard), squares (ChArUco) or circles."""

    kind: Literal["chessboard", "charuco", "circles", "asymmetric-circles"] = "chessboard"
    columns: Annotated[int, Field(ge=2, le=200)]
    rows: Annotated[int, Field(ge=2, le=200)]
    square_m: Annotated[float, Field(gt=0, le=10)]
    marker_m: Annotated[float | None, Field(gt=0, le=10)] = None
    dictionary: str = "DICT_5X5_250"

    def board(self) -> Board:
        """The board. Raises BadInputError for a combination that cannot be."""
        try:
            if self.kind == "chessboard":
                return Chessboard(self.columns, self.rows, self.square_m)
            if self.kind == "charuco":
                marker_m = self.marker_m or 0.75 * self.square_m
                return CharucoBoard(self.columns, self.rows, self.square_m, marker_m, self.dictionary)
            asymmetric = self.kind == "asymmetric-circles"
            return CircleGrid(self.columns, self.rows, self.square_m, asymmetric)
        except CalibrationError as error:
            raise BadInputError(str(error)) from error


class ProjectorSettings(Strict):
    """How the projector is spoken to: `airlens projector` takes the same address.

    `simulated:?warm_up_s=15&cool_down_s=10` is a twin, of an Epson unless a dialect stands after the colon.
    """

    url: str


class RigSettings(Strict):
    """The devices of the rig, and the board that it is calibrated with. No device stands in for one not named."""

    camera: CameraSettings | None = None
    projector: ProjectorSettings | None = None
    board: BoardSettings | None = None

    @property
    def camera_kind(self) -> str:
        """The kind of camera that is named; `none` where none is."""
        return "none" if self.camera is None else self.camera.kind

    @property
    def addresses(self) -> tuple[str, ...]:
        """The device files and hosts that this rig opens; simulated twins open none."""
        camera = (self.camera.device,) if isinstance(self.camera, V4l2CameraSettings) else ()
        named = () if self.projector is None else (self.projector.url,)
        return camera + tuple(url for url in named if not url.startswith("simulated:"))
