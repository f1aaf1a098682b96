"""From the `[rig]` table to open devices. The only module that knows the simulated twins."""

from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

import numpy as np
from jaxtyping import Float32

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.rig_settings import CameraSettings, ProjectorSettings, SimulatedCameraSettings
from app.experiment.views import camera_number
from app.rig.cameras import open_real
from app.rig.inventory import found_cameras
from app.rig.practice_room import PracticeRoom
from app.rig.projectors import open_real_projector
from app.rig.rendered import VIEWS_APART, AirState, moving_pictures, seen_picture
from app.rig.stage import RealStage, Stage, StageTask
from calibration.board import Board
from core.geometry import Optics
from core.scene import ProjectedPattern, Scene
from core.view_frame import facing, turn_of
from drivers.burst import CaptureRole
from drivers.clock import Clock, SystemClock
from drivers.display import PatternDisplay, Picture
from drivers.projector.protocol import Projector
from drivers.protocols import Camera
from drivers.simulated import SensorNoise, SimulatedCamera, SimulatedDisplay
from drivers.simulated.projector.open import TWINS, open_twin

# A lamp that warms up for longer than an hour is a slip.
LONGEST_S = 3600.0
# A simulated room is as bright as fills a camera's well in this time where its pattern is white.
_FULL_WELL_S = 0.02


def open_camera(experiment: Experiment, air: AirState, view: int = 0, moment: int | None = None) -> Camera:
    """Open the camera of a view. `air` says what a simulated room does; a real room is as it is.

    A simulated mount walks: `moment` is how many steps it has taken, by default one where the air moves.
    """
    settings = named_camera(experiment, view)
    if isinstance(settings, SimulatedCameraSettings):
        steps = int(air == "moving") if moment is None else moment
        return _simulated_camera(experiment, settings, air, view, steps)
    return open_real(settings)


def named_camera(experiment: Experiment, view: int = 0) -> CameraSettings:
    """The camera that the experiment names for a view; all are simulated where the first one is.

    A view that another one's camera takes has that one's. Raises BadInputError, with the cameras found, where it
    names none.
    """
    rig, view = experiment.settings.rig, camera_number(experiment, view)
    settings = rig.camera
    if view > 0 and settings is not None and not isinstance(settings, SimulatedCameraSettings):
        name = experiment.settings.scene.views[view].name
        settings = (rig.cameras or {}).get(name)
        if settings is None:
            raise BadInputError(
                f"The rig of {experiment.folder.name} names no camera for its view {name!r}. Add to its "
                f'experiment.toml: [rig.cameras."{name}"] with the same keys as [rig.camera].'
            )
    if settings is not None:
        return settings
    found = ", ".join(f"{one.device} ({one.name})" for one in found_cameras() if one.device) or "none"
    raise BadInputError(
        f"The rig of {experiment.folder.name} names no camera. Cameras found on this machine: {found}. Add to its "
        'experiment.toml: [rig.camera] with kind = "v4l2", device, width_px, height_px and exposure_s; '
        'or with kind = "simulated" for a rig that is computed.'
    )


def clock_of(camera: Camera) -> Clock:
    """The time that bursts of this camera are waited for in: a simulated room's passes at once."""
    return camera.clock if isinstance(camera, SimulatedCamera) else SystemClock()


def air_of(role: CaptureRole) -> AirState:
    """What the air of a simulated room does during a capture of that role; for dark frames the lens is covered."""
    if role == "dark":
        return "covered"
    return "moving" if role == "flow" else "still"


def open_projector(experiment: Experiment, view: int = 0) -> Projector:
    """Return the projector of a view; its line opens when it is first asked. Raises BadInputError."""
    settings = named_projector(experiment, view)
    if settings is None:
        name = experiment.settings.scene.views[view].name
        whose, table = (
            ("", "[rig.projector]") if view == 0 else (f" for {name!r}", f'[rig.projectors."{name}"]')
        )
        raise BadInputError(
            f"The rig of {experiment.folder.name} names no projector{whose}. Add to its experiment.toml: "
            f'{table} with url = "pjlink://ADDRESS" or "escvp21:/dev/ttyUSB0".'
        )
    return _twin(settings.url) if settings.url.startswith("simulated:") else open_real_projector(settings.url)


def named_projector(experiment: Experiment, view: int = 0) -> ProjectorSettings | None:
    """The projector that the experiment names for a view; None where it names none."""
    rig, name = experiment.settings.rig, experiment.settings.scene.views[view].name
    return rig.projector if view == 0 else (rig.projectors or {}).get(name)


def _twin(url: str) -> Projector:
    """The twin of a dialect (else of an Epson): `simulated:benq?warm_up_s=15&cool_down_s=10` sets its times."""
    try:
        parts = urlsplit(url)
        asked = parse_qs(parts.query)
        warm_up_s, cool_down_s = (float(asked[name][-1]) for name in ("warm_up_s", "cool_down_s"))
        if not (0 <= warm_up_s <= LONGEST_S and 0 <= cool_down_s <= LONGEST_S):
            raise ValueError(f"expected times of 0 to {LONGEST_S:g} s")
        return open_twin(parts.path or "escvp21", SystemClock(), warm_up_s, cool_down_s)
    except (KeyError, ValueError) as error:
        raise BadInputError(
            f"{url!r} is no simulated projector ({error}); expected simulated:?warm_up_s=15&cool_down_s=10, "
            f"the dialect after the colon: {', '.join(TWINS)}."
        ) from None


def open_stage(
    experiment: Experiment, board: Board | None, display: PatternDisplay | None = None, view: int = 0
) -> Stage:
    """Open the rig of a view for calibration; a real projector's screen is given as `display`."""
    settings, scene = named_camera(experiment, view), experiment.settings.scene
    if isinstance(settings, SimulatedCameraSettings):
        return PracticeStage(scene, settings, board, view)
    return RealStage(open_real(settings), display, panel_of(scene, view))


def panel_of(scene: Scene, view: int = 0) -> tuple[int, int] | None:
    """Native width and height of the projector that lights a view's wall; None for a fixed texture."""
    light = scene.views[view].light or scene.light
    return (
        (light.projector.width_px, light.projector.height_px) if isinstance(light, ProjectedPattern) else None
    )


class PracticeStage:
    """A simulated rig whose boards, wall and light arrange themselves: see `app.rig.stage.Stage`.

    It stands in the view's own frame, where its wall is y_max: pictures are the same there.
    """

    arranges_itself = True

    def __init__(
        self, scene: Scene, settings: SimulatedCameraSettings, board: Board | None, view: int
    ) -> None:
        name, noise = scene.views[view].name, _sensor(scene, settings, view)
        self.panel_px = panel_of(scene, view)
        framed, number = facing(scene, view)
        self._room = PracticeRoom(framed, number, board, turn_of(scene, view))
        light = framed.light
        panel = light.projector if isinstance(light, ProjectedPattern) else None
        self.display = None if panel is None else _PracticeDisplay(panel, self._room.show)
        self.camera = SimulatedCamera(
            self._room,
            seed=2 * settings.seed + VIEWS_APART * view,
            noise=noise,
            exposure_s=settings.exposure_s,
            full_well_exposure_s=_FULL_WELL_S,
            name=f"simulated {name}",
        )

    def arrange(self, task: StageTask) -> None:
        """Move the board, cover the lens."""
        self._room.arrange(task)


class _PracticeDisplay:
    """A simulated screen that lights the simulated room."""

    def __init__(self, panel: Optics, light: Callable[[Picture], None]) -> None:
        self._screen = SimulatedDisplay(panel.height_px, panel.width_px)
        self._light = light

    def show(self, picture: Picture) -> str:
        digest = self._screen.show(picture)
        self._light(picture)
        return digest

    def is_showing(self, digest: str) -> bool:
        return self._screen.is_showing(digest)

    def close(self) -> None:
        self._screen.close()


def _sensor(scene: Scene, settings: SimulatedCameraSettings, view: int) -> SensorNoise:
    if settings.noise_free:
        # So many photons that shot noise is 1e-6, and the finest digits there are.
        return SensorNoise(1e12, 0.0, 64.0, 16)
    noise = scene.views[view].noise
    return SensorNoise(noise.full_well_e, noise.read_noise_e, noise.dark_counts, noise.bits)


def _simulated_camera(
    experiment: Experiment, settings: SimulatedCameraSettings, air: AirState, view: int, steps: int
) -> SimulatedCamera:
    scene = experiment.settings.scene
    moves = air == "moving" and settings.snapshots is not None
    moving = moving_pictures(experiment, settings, view, steps) if moves else None
    image = _memo(
        (lambda: seen_picture(experiment, settings, air, view, steps))
        if moving is None
        else (lambda: moving(0.0))
    )
    return SimulatedCamera(
        image,
        moving=moving,
        frame_rate_hz=settings.frame_rate_hz,
        seed=2 * settings.seed + steps + VIEWS_APART * view,
        noise=_sensor(scene, settings, view),
        flicker=settings.world.flicker,
        exposure_s=settings.exposure_s,
        full_well_exposure_s=_FULL_WELL_S,
        name=f"simulated {scene.views[view].name}",
    )


def _memo(
    make: Callable[[], Float32[np.ndarray, "rows cols"]],
) -> Callable[[], Float32[np.ndarray, "rows cols"]]:
    """The same array at every call: the twin then draws from it without preparing it again."""
    made: list[Float32[np.ndarray, "rows cols"]] = []

    def view() -> Float32[np.ndarray, "rows cols"]:
        if not made:
            made.append(make())
        return made[0]

    return view
