"""Which devices make up the rig: the `[rig]` table of experiment.toml."""

from typing import Annotated, Literal

from pydantic import Field

from app.errors import BadInputError
from app.files.toml import Strict
from calibration.board import Board, board_of
from calibration.board_kind import BoardKind
from calibration.errors import CalibrationError


class World(Strict):
    """What spoils the pictures of a simulated rig, each by itself; 0 is without it.

    `app.rig.nuisances` says how each acts. A shake, a lamp and a focus differ from burst to burst, a lens does not.
    """

    blur_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Blur of the lens: standard deviation of its spot."""
    vignetting: Annotated[float, Field(ge=0, le=0.95)] = 0.0
    """Share of the light that is missing in the picture's corners."""
    vibration_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Shake within a burst: standard deviation, half as much to half as much again."""
    breathing_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    """How far the focus moves the picture's edge, in or out, from burst to burst."""
    lamp: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share by which the light changes from burst to burst."""
    ripple: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share by which the light ripples over the wall, otherwise in each burst."""
    ripple_period_px: Annotated[float, Field(gt=1, le=10_000)] = 60.0
    """Period of that ripple."""
    flicker: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share by which the light changes from frame to frame."""
    hot_pixels: Annotated[float, Field(ge=0, le=0.1)] = 0.0
    """Share of the pixels that are always full."""
    marks_blur_px: Annotated[float, Field(ge=0, le=50)] = 0.0
    """Blur of marks near the camera, out of focus: standard deviation of the spot."""
    covered: Annotated[float, Field(ge=0, le=0.9)] = 0.0
    """Share of the picture behind things before the wall; every second one moves between bursts."""


class SimulatedCameraSettings(Strict):
    """A camera twin that looks at a room volume in the experiment folder."""

    kind: Literal["simulated"] = "simulated"
    """A camera that computes its pictures."""
    room: str = "truth.npz"
    """The room that it looks at, in the experiment."""
    snapshots: str | None = None
    """The air of that room at several moments, in the experiment; without them the air is steady."""
    exposure_s: Annotated[float, Field(gt=0, le=60)] = 0.02
    """Exposure of a frame; in 0.02 s the pattern's white fills the well."""
    frame_rate_hz: Annotated[float, Field(gt=0, le=10_000)] = 30.0
    """Frames a second, at most."""
    seed: int = 0
    """Of noise and drift."""
    drift_px: Annotated[float, Field(ge=0, le=20)] = 0.0
    """How far the camera moves between reference and flow."""
    border: Literal["print", "bare", "room"] = "print"
    """What is beyond the wall: a still print, nothing to see, or the room's other walls behind the same air."""
    noise_free: bool = False
    """Whether its frames have no noise."""
    world: World = World()
    """What spoils its pictures."""


class V4l2CameraSettings(Strict):
    """A camera that the kernel knows (Video for Linux).

    `frame_rate_hz` is the camera's own unless given; automatic exposure, gain, white balance and focus are
    switched off unless `automatics_off` is false.
    """

    kind: Literal["v4l2"]
    """A camera of the kernel."""
    device: str = "/dev/video0"
    """Its device file; `airlens devices` lists them."""
    pixel_format: str = "Y16"
    """Raw or grey format, as the kernel names it."""
    width_px: Annotated[int, Field(gt=0)]
    """Columns."""
    height_px: Annotated[int, Field(gt=0)]
    """Rows."""
    bits: Annotated[int | None, Field(ge=1, le=16)] = None
    """Digits of a count, where the camera has fewer than the format; the format's unless given."""
    exposure_s: Annotated[float | None, Field(gt=0, le=60)] = None
    """Exposure of a frame; the camera's own unless given."""
    gain: float | None = None
    """In the camera's own unit; its own unless given."""
    frame_rate_hz: Annotated[float | None, Field(gt=0, le=10_000)] = None
    """Frames a second; the camera's own unless given."""
    automatics_off: bool = True
    """Whether automatic exposure, gain, white balance and focus are switched off."""


class AravisCameraSettings(Strict):
    """A GigE Vision or USB3 Vision camera, where the system's library Aravis is installed.

    `frame_rate_hz` is the camera's own unless given; automatic exposure and gain are switched off unless
    `automatics_off` is false.
    """

    kind: Literal["aravis"]
    """A GigE Vision or USB3 Vision camera."""
    device: str
    """Its id, as `airlens devices` lists it, or its address on the network."""
    pixel_format: str = "Mono8"
    """Grey format, as the standard names it."""
    width_px: Annotated[int, Field(gt=0)]
    """Columns."""
    height_px: Annotated[int, Field(gt=0)]
    """Rows."""
    bits: Annotated[int | None, Field(ge=1, le=16)] = None
    """Digits of a count, where the camera has fewer than the format; the format's unless given."""
    exposure_s: Annotated[float | None, Field(gt=0, le=60)] = None
    """Exposure of a frame; the camera's own unless given."""
    gain: float | None = None
    """In the camera's own unit; its own unless given."""
    frame_rate_hz: Annotated[float | None, Field(gt=0, le=10_000)] = None
    """Frames a second; the camera's own unless given."""
    automatics_off: bool = True
    """Whether automatic exposure and gain are switched off."""


RealCameraSettings = V4l2CameraSettings | AravisCameraSettings
CameraSettings = Annotated[SimulatedCameraSettings | RealCameraSettings, Field(discriminator="kind")]


class BoardSettings(Strict):
    """The board that the rig is calibrated with: inner corners (chessboard), squares (ChArUco) or circles."""

    kind: BoardKind = "chessboard"
    """What is on the board."""
    columns: Annotated[int, Field(ge=2, le=200)]
    """Inner corners, ChArUco squares, or circles in a row."""
    rows: Annotated[int, Field(ge=2, le=200)]
    """The same in a column."""
    square_m: Annotated[float, Field(gt=0, le=10)]
    """A square's edge, or the circles' spacing."""
    marker_m: Annotated[float | None, Field(gt=0, le=10)] = None
    """A ChArUco marker's edge; 0.75 of a square unless given."""
    dictionary: str = "DICT_5X5_250"
    """ChArUco's markers, as OpenCV names them."""

    def board(self) -> Board:
        """The board. Raises BadInputError for a combination that cannot be."""
        try:
            return board_of(self.kind, self.columns, self.rows, self.square_m, self.marker_m, self.dictionary)
        except CalibrationError as error:
            raise BadInputError(str(error)) from error


class ProjectorSettings(Strict):
    """How the projector is spoken to: `airlens projector` takes the same address.

    `simulated:?warm_up_s=15&cool_down_s=10` is a twin, of an Epson unless a dialect stands after the colon.
    """

    url: str
    """Its address: dialect, then host or serial port."""


class RigSettings(Strict):
    """The devices of the rig, and the board that it is calibrated with. No device stands in for one not named."""

    camera: CameraSettings | None = None
    """The camera; of several views, the first one's."""
    cameras: dict[str, CameraSettings] | None = None
    """The cameras of the other views, by the view's name; a simulated rig needs none."""
    projector: ProjectorSettings | None = None
    """The projector, where it is spoken to."""
    projectors: dict[str, ProjectorSettings] | None = None
    """The projectors of other views, by the view's name; where one camera sees several, all must be spoken to."""
    board: BoardSettings | None = None
    """The board for calibration."""

    @property
    def camera_kind(self) -> str:
        """The kind of camera that is named; `none` where none is."""
        return "none" if self.camera is None else self.camera.kind

    @property
    def addresses(self) -> tuple[str, ...]:
        """The device files and hosts that this rig opens; simulated twins open none."""
        cameras = (self.camera, *(self.cameras or {}).values())
        camera = tuple(one.device for one in cameras if isinstance(one, RealCameraSettings))
        return camera + tuple(url for url in self.projector_urls if not url.startswith("simulated:"))

    @property
    def projector_urls(self) -> tuple[str, ...]:
        """The addresses of the projectors that are named, the first view's before the others'."""
        first = () if self.projector is None else (self.projector,)
        return tuple(one.url for one in (*first, *(self.projectors or {}).values()))
