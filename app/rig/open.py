"""From the `[rig]` table to open devices. The only module that knows the simulated twins."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal
from urllib.parse import parse_qs, urlsplit

import numpy as np
from jaxtyping import Float32

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.rig_settings import CameraSettings, SimulatedCameraSettings
from app.rig.cameras import open_v4l2
from app.rig.practice_room import PracticeRoom
from app.rig.projectors import open_real_projector
from app.rig.stage import RealStage, Stage, Task
from app.volume.file import RoomVolume, read_volume
from calibration.board import Board
from core.fields import GridField
from core.geometry import Box, Optics, crop, rotation_matrix, rotation_vector
from core.plan.print_choice import suited_print
from core.render import render_flow, render_reference
from core.scene import ProjectedPattern, Scene
from drivers.burst import CaptureRole
from drivers.clock import SystemClock
from drivers.display import PatternDisplay, Picture
from drivers.projector.protocol import Projector
from drivers.protocols import Camera
from drivers.simulated import SensorNoise, SimulatedCamera, SimulatedDisplay
from drivers.simulated.projector.open import TWINS, open_twin
from drivers.v4l2 import list_devices

# A lamp that warms up for longer than an hour is a slip.
LONGEST_S = 3600.0
AirState = Literal["still", "moving"]

# The print around a simulated room: as fine as the pattern, but another one.
FRAME_SEED = 1_000_003


def open_camera(experiment: Experiment, air: AirState, view: int = 0, moment: int | None = None) -> Camera:
    """Open the experiment's camera. `air` says what a simulated room does; a real room is as it is.

    A simulated mount walks: `moment` is how many steps it has taken, by default one where the air moves.
    """
    settings = named_camera(experiment)
    if isinstance(settings, SimulatedCameraSettings):
        steps = int(air == "moving") if moment is None else moment
        return _simulated_camera(experiment, settings, air, view, steps)
    return open_v4l2(settings)


def named_camera(experiment: Experiment) -> CameraSettings:
    """The camera that the experiment names. Raises BadInputError, with the cameras found, where it names none."""
    settings = experiment.settings.rig.camera
    if settings is not None:
        return settings
    found = ", ".join(f"{device.path} ({device.name})" for device in list_devices()) or "none"
    raise BadInputError(
        f"The rig of {experiment.folder.name} names no camera. Cameras found on this machine: {found}. Add to its "
        'experiment.toml: [rig.camera] with kind = "v4l2", device, width_px, height_px and exposure_s; '
        'or with kind = "simulated" for a rig that is computed.'
    )


def air_of(role: CaptureRole) -> AirState:
    """What the air of a simulated room does during a capture of that role."""
    return "moving" if role == "flow" else "still"


def open_projector(experiment: Experiment) -> Projector:
    """Return the experiment's projector; its line opens when it is first asked. Raises BadInputError."""
    settings = experiment.settings.rig.projector
    if settings is None:
        raise BadInputError(
            f"The rig of {experiment.folder.name} names no projector. Add to its experiment.toml: "
            '[rig.projector] with url = "pjlink://ADDRESS" or "escvp21:/dev/ttyUSB0".'
        )
    return _twin(settings.url) if settings.url.startswith("simulated:") else open_real_projector(settings.url)


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
    """Open the experiment's rig for calibration; a real projector's screen is given as `display`."""
    settings, scene = named_camera(experiment), experiment.settings.scene
    if isinstance(settings, SimulatedCameraSettings):
        return PracticeStage(scene, settings, board, view)
    return RealStage(open_v4l2(settings), display, panel_of(scene))


def panel_of(scene: Scene) -> tuple[int, int] | None:
    """Native width and height of the scene's projector; None for a fixed texture."""
    light = scene.light
    return (
        (light.projector.width_px, light.projector.height_px) if isinstance(light, ProjectedPattern) else None
    )


class PracticeStage:
    """A simulated rig whose boards, wall and light arrange themselves: see `app.rig.stage.Stage`."""

    arranges_itself = True

    def __init__(
        self, scene: Scene, settings: SimulatedCameraSettings, board: Board | None, view: int
    ) -> None:
        self._room = PracticeRoom(scene, view, board)
        self.panel_px = panel_of(scene)
        light = scene.light
        panel = light.projector if isinstance(light, ProjectedPattern) else None
        self.display = None if panel is None else _PracticeDisplay(panel, self._room.show)
        self.camera = SimulatedCamera(
            self._room,
            seed=2 * settings.seed,
            noise=_sensor(scene, settings, view),
            exposure_s=settings.exposure_s,
            name=f"simulated {scene.views[view].name}",
        )

    def arrange(self, task: Task) -> None:
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
    sensor = _sensor(scene, settings, view)
    for step in range(steps):
        scene = drifted(scene, view, settings.drift_px, settings.seed + step)
    image = _memo(lambda: _render(experiment, settings, scene, air, view))
    return SimulatedCamera(
        image,
        seed=2 * settings.seed + steps,
        noise=sensor,
        exposure_s=settings.exposure_s,
        name=f"simulated {scene.views[view].name}",
    )


def _render(
    experiment: Experiment, settings: SimulatedCameraSettings, scene: Scene, air: AirState, view: int
) -> Float32[np.ndarray, "rows cols"]:
    if air == "still":
        image = render_reference(scene, view)
    else:
        volume = read_volume(experiment.file(settings.room))
        image = render_flow(scene, volume_field(volume, scene), view)
    return _framed(image, scene, view) if settings.border == "print" else image


def _framed(
    image: Float32[np.ndarray, "rows cols"], scene: Scene, view: int
) -> Float32[np.ndarray, "rows cols"]:
    """The picture in a printed frame: what lies beyond the wall is still, and shows the camera's drift."""
    beyond = image == 0
    room, reach_m = scene.room, 0.1 * max(scene.room.size_m)
    (x0, y0, z0), (x1, y1, z1) = room.lower_m, room.upper_m
    wide = Box(lower_m=(x0 - reach_m, y0, z0 - reach_m), upper_m=(x1 + reach_m, y1, z1 + reach_m))
    camera = scene.views[view].camera
    print_ = suited_print(camera, y1 - camera.position_m[1], FRAME_SEED)
    frame_scene = replace(scene, room=wide, light=print_)
    framed = image.copy()
    for strip in _strips_around(~beyond):
        part = replace(scene.views[view], camera=crop(camera, *strip))
        views = tuple(part if i == view else v for i, v in enumerate(scene.views))
        drawn = render_reference(replace(frame_scene, views=views), view)
        framed[strip] = np.where(beyond[strip], drawn, image[strip])
    return framed


def _strips_around(inside: np.ndarray) -> list[tuple[slice, slice]]:
    """The four strips (rows, columns) around the bounding box of what is inside."""
    rows, cols = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return [(slice(0, inside.shape[0]), slice(0, inside.shape[1]))]
    # One pixel more, for a box that is not quite upright in the picture.
    top, bottom = int(rows[0]) + 2, int(rows[-1]) - 1
    left, right = int(cols[0]) + 2, int(cols[-1]) - 1
    strips = [
        (slice(0, top), slice(0, inside.shape[1])),
        (slice(bottom, inside.shape[0]), slice(0, inside.shape[1])),
        (slice(top, bottom), slice(0, left)),
        (slice(top, bottom), slice(right, inside.shape[1])),
    ]
    return [(r, c) for r, c in strips if r.stop > r.start and c.stop > c.start]


def volume_field(volume: RoomVolume, scene: Scene) -> GridField:
    """The volume's excess refractivity on evenly spaced vertices."""
    excess_k = _evenly_spaced(volume).astype(np.float64) - scene.air.ambient_temperature_k
    excess = -scene.air.ambient_refractivity * excess_k / (scene.air.ambient_temperature_k + excess_k)
    room: Box = scene.room
    return GridField(room.lower_m, room.upper_m, excess.astype(np.float32))


def drifted(scene: Scene, view: int, drift_px: float, seed: int) -> Scene:
    """The scene with one camera moved between exposures: a shift of `drift_px` and a roll as large at the edge."""
    if drift_px == 0.0:
        return scene
    rng = np.random.default_rng([seed, 77])
    camera = scene.views[view].camera
    angle = rng.uniform(0, 2 * np.pi)
    roll = rng.choice([-1.0, 1.0]) * drift_px / camera.width_px
    moved = _moved(camera, drift_px * np.cos(angle), drift_px * np.sin(angle), roll)
    views = list(scene.views)
    views[view] = replace(views[view], camera=moved)
    return replace(scene, views=tuple(views))


def _moved(camera: Optics, column_px: float, row_px: float, roll_rad: float) -> Optics:
    cx, cy = camera.principal_px
    rotation = rotation_matrix((0.0, 0.0, float(roll_rad))) @ camera.rotation
    return replace(
        camera,
        principal_px=(float(cx + column_px), float(cy + row_px)),
        rotation_rad=rotation_vector(rotation),
    )


def _evenly_spaced(volume: RoomVolume) -> Float32[np.ndarray, "nx ny nz"]:
    """Temperature on evenly spaced vertices, at least as fine as the volume's own."""
    temperature = volume.temperature_k
    for index, axis in enumerate((volume.x_m, volume.y_m, volume.z_m)):
        steps = np.diff(axis)
        if steps.max() - steps.min() > 1e-4 * steps.max():
            count = int(np.ceil((axis[-1] - axis[0]) / steps.min())) + 1
            even = np.linspace(axis[0], axis[-1], min(count, 512))
            temperature = np.apply_along_axis(
                lambda line, even=even, axis=axis: np.interp(even, axis, line), index, temperature
            )
    return temperature.astype(np.float32)


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
