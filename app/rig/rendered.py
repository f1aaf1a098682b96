"""What a simulated camera sees: the experiment's room, rendered, on a mount that creeps."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.experiment.views import camera_number
from app.rig.beyond_wall import in_frame, in_room, with_marks
from app.rig.nuisances import Back, spoiled
from app.volume.file import RoomVolume, read_volume
from app.volume.scene import room_box, room_objects
from app.volume.snapshots import read_snapshots
from core.fields import GridField
from core.geometry import Box, rotation_matrix, rotation_vector
from core.lens import on_plane, seen_at
from core.rays.visibility import first_hit, wall_points
from core.render import render_flow, render_reference
from core.scene import ProjectedPattern, Scene
from core.view_frame import each_alone, facing, field_facing, turn_of

# Seeds of one view after those of another: each camera has noise and a mount of its own.
VIEWS_APART = 7919

# Rows drawn at a time; what a shadow leaves of the light; periods of what is seen on an object, along x, y, z.
_ROWS, _UNLIT, _FOLDS_M = 256, 0.02, np.array([0.31, 0.97, 0.23])

# What a simulated camera has before it: air that does one or the other, or a cover on its lens.
AirState = Literal["still", "moving", "covered"]
Picture = Float32[np.ndarray, "rows cols"]
Picture1 = Float32[np.ndarray, " pixels"]


def seen_picture(
    experiment: Experiment, settings: SimulatedCameraSettings, air: AirState, view: int, steps: int
) -> Picture:
    """The luminance of every pixel after so many steps of the mount; 1 fills the well. Raises BadInputError."""
    if air == "covered":
        optics = experiment.settings.scene.views[view].camera
        return np.zeros((optics.height_px, optics.width_px), np.float32)
    scene = _mounted(experiment, settings, view, steps)
    volume = read_volume(experiment.file(settings.room))
    field = None if air == "still" else volume_field(volume, scene)
    picture = _rendered(volume, experiment, settings, scene, field, view)
    back = _before_the_mount_crept(experiment, scene, view)
    return spoiled(picture, settings.world, steps, settings.seed + VIEWS_APART * view, back)


def moving_pictures(
    experiment: Experiment, settings: SimulatedCameraSettings, view: int, steps: int
) -> Callable[[float], Picture]:
    """What is seen at a time [s]: the picture of the snapshot nearest to it, the same array while that stays.

    Raises BadInputError.
    """
    if settings.snapshots is None:
        raise BadInputError("This simulated camera has no snapshots; state rig.camera.snapshots.")
    scene = _mounted(experiment, settings, view, steps)
    volume = read_volume(experiment.file(settings.room))
    snapshots = read_snapshots(experiment.file(settings.snapshots), scene.room)

    @lru_cache(maxsize=2)
    def picture(index: int) -> Picture:
        field = temperature_field(snapshots.temperature_k[index], scene)
        drawn = _rendered(volume, experiment, settings, scene, field, view)
        back = _before_the_mount_crept(experiment, scene, view)
        return spoiled(drawn, settings.world, steps, settings.seed + VIEWS_APART * view, back)

    return lambda time_s: picture(snapshots.nearest(time_s))


def _mounted(experiment: Experiment, settings: SimulatedCameraSettings, view: int, steps: int) -> Scene:
    """The scene after so many steps of the mount; views that one camera takes stand on one mount."""
    scene, mount = _as_it_is(experiment, settings), camera_number(experiment, view)
    for step in range(steps):
        scene = drifted(
            scene,
            view,
            settings.drift_px,
            settings.world.breathing_px,
            settings.seed + step + VIEWS_APART * mount,
        )
    return scene


def _before_the_mount_crept(experiment: Experiment, scene: Scene, view: int) -> Back:
    """Where the pixels of this view were before its camera turned, and its lens breathed."""
    before, now = experiment.settings.scene.views[view].camera, scene.views[view].camera

    def back(points_px: Float[np.ndarray, "... 2"]) -> Float[np.ndarray, "... 2"]:
        plane = on_plane(now, points_px.reshape(-1, 2))
        ray = np.column_stack([plane, np.ones(len(plane))]) @ (before.rotation @ now.rotation.T).T
        return seen_at(before, ray[:, :2] / ray[:, 2:]).reshape(points_px.shape)

    return back


def _as_it_is(experiment: Experiment, settings: SimulatedCameraSettings) -> Scene:
    """The scene with the simulated room's own walls: what was stated of them may be wrong by a centimetre."""
    scene, path = experiment.settings.scene, experiment.folder / settings.room
    return (
        replace(scene, room=room_box(read_volume(path)), boundary=(), objects=()) if path.is_file() else scene
    )


def _rendered(
    volume: RoomVolume,
    experiment: Experiment,
    settings: SimulatedCameraSettings,
    scene: Scene,
    field: GridField | None,
    view: int,
) -> Picture:
    """The room through this air, or through still air; with its frame and its objects."""
    image = render_reference(scene, view) if field is None else render_flow(scene, field, view)
    # What stands in the room, whether or not the scene states it.
    stated, turned = view, None if field is None else field_facing(field, turn_of(scene, view))
    scene, view = facing(each_alone(replace(scene, objects=room_objects(volume))), view)
    # Prints keep their size when the lens breathes.
    focal_px = experiment.settings.scene.views[stated].camera.focal_px[0]
    if settings.border == "print":
        image = in_frame(image, scene, view, focal_px)
    elif settings.border == "room":
        image = in_room(image, scene, view, focal_px, turned)
    return with_marks(with_objects(image, scene, view), scene, view, focal_px, settings.world.marks_blur_px)


def with_objects(image: Picture, scene: Scene, view: int) -> Picture:
    """The picture with the scene's objects before the wall, and dark where they keep the projector's light off it."""
    shown = image.copy() if scene.objects else image
    columns = np.arange(image.shape[1], dtype=float)
    for first in range(0, image.shape[0] if scene.objects else 0, _ROWS):
        rows = np.arange(first, min(first + _ROWS, image.shape[0]), dtype=float)
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        block = shown[first : first + len(rows)].reshape(-1)
        _draw_objects(block, pixels, scene, view)
        shown[first : first + len(rows)] = block.reshape(len(rows), -1)
    return shown


def _draw_objects(block: Picture1, pixels: Float[np.ndarray, "pixels 2"], scene: Scene, view: int) -> None:
    wall_m, eye_m = wall_points(scene, view, pixels), np.array(scene.views[view].camera.position_m)
    nearest = np.full(len(pixels), np.inf)
    for item in scene.objects:
        if isinstance(scene.light, ProjectedPattern):
            lamp_m = np.array(scene.light.projector.position_m)
            shade = np.isfinite(first_hit(item, lamp_m, wall_m)) & ~np.isfinite(nearest)
            block[shade] *= _UNLIT
        met = first_hit(item, eye_m, wall_m)
        seen = met < nearest
        at_m = eye_m + met[seen, None] * (wall_m[seen] - eye_m)
        waves = np.sin(2 * np.pi * at_m / _FOLDS_M)
        block[seen] = np.clip(0.4 + 0.15 * waves.prod(axis=1), 0.02, 0.9)
        nearest[seen] = met[seen]


def volume_field(volume: RoomVolume, scene: Scene) -> GridField:
    """The volume's excess refractivity on evenly spaced vertices."""
    return temperature_field(_evenly_spaced(volume), scene)


def temperature_field(temperature_k: Float32[np.ndarray, "nx ny nz"], scene: Scene) -> GridField:
    """The excess refractivity of these temperatures on evenly spaced vertices."""
    excess_k = temperature_k.astype(np.float64) - scene.air.ambient_temperature_k
    excess = -scene.air.ambient_refractivity * excess_k / (scene.air.ambient_temperature_k + excess_k)
    room: Box = scene.room
    return GridField(room.lower_m, room.upper_m, excess.astype(np.float32))


def drifted(scene: Scene, view: int, drift_px: float, breathing_px: float, seed: int) -> Scene:
    """The scene with one camera moved between exposures.

    It turns by `drift_px` on its optical axis, in any direction, and rolls by as much at the picture's edge; its lens
    magnifies by `breathing_px` there.
    """
    if drift_px == breathing_px == 0.0:
        return scene
    rng = np.random.default_rng([seed, 77])
    camera = scene.views[view].camera
    angle = rng.uniform(0, 2 * np.pi)
    roll_rad = rng.choice([-1.0, 1.0]) * drift_px / camera.width_px
    grown = 1.0 + rng.choice([-1.0, 1.0]) * 2.0 * breathing_px / camera.width_px
    fx, fy = camera.focal_px
    turn_rad = (float(-drift_px * np.sin(angle) / fy), float(drift_px * np.cos(angle) / fx), float(roll_rad))
    moved = replace(
        camera,
        focal_px=(float(grown * fx), float(grown * fy)),
        rotation_rad=rotation_vector(rotation_matrix(turn_rad) @ camera.rotation),
    )
    views = tuple(replace(v, camera=moved) if n == view else v for n, v in enumerate(scene.views))
    return replace(scene, views=views)


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
