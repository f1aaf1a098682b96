"""Answers to the scene and the rig that they describe. Raises BadInputError with the answer's name."""

import math
from dataclasses import replace

from app.errors import BadInputError
from app.experiment.folder import TRUTH_FILE, ExperimentSettings
from app.experiment.rig_settings import (
    AravisCameraSettings,
    ProjectorSettings,
    RigSettings,
    SimulatedCameraSettings,
    V4l2CameraSettings,
)
from app.setup.answers import Answers, CameraAnswer, ObjectAnswer, OpeningAnswer, SupplyAnswer
from app.setup.mistakes import contradictions, field_name
from app.volume.scene import projected
from core.air import Air
from core.geometry import WALLS, Box, Optics, Vector3, face_of, looking_along_y
from core.objects import RoomObject, ready_object
from core.plan.print_choice import suited_print
from core.scene import (
    BoundaryInformation,
    CameraNoise,
    Heater,
    Inlet,
    Light,
    Outlet,
    Patch,
    PointSensors,
    Scene,
    View,
    Wall,
)
from core.setting import SettingError

SENSORS_FILE = "boundary/sensors.csv"


def settings_of(answers: Answers, corner_m: Vector3 = (0.0, 0.0, 0.0)) -> ExperimentSettings:
    """The experiment's settings; `corner_m` is where the world has the corner that answers are measured from.

    Raises BadInputError: an opening off its wall, two in one place, trapped air.
    """
    wrong = contradictions(answers)
    if wrong:
        raise BadInputError("; ".join(f"{field_name(one.path)}: {one.message}" for one in wrong))
    return described(answers, corner_m)


def described(answers: Answers, corner_m: Vector3) -> ExperimentSettings:
    """The same of answers that may contradict one another: a scene that somebody wrote may. Raises BadInputError."""
    room = Box(lower_m=corner_m, upper_m=_moved(answers.room, corner_m))
    try:
        optics = _optics(answers.camera, room)
        scene = Scene(
            room=room,
            air=Air(ambient_temperature_k=answers.air),
            views=(
                View(
                    camera=optics, noise=CameraNoise(bits=answers.camera.bits), frames=answers.camera.frames
                ),
            ),
            light=_light(answers, optics, room),
            boundary=tuple(_boundary(answers, room)),
            objects=tuple(object_of(item, n, room.lower_m) for n, item in enumerate(answers.object)),
        )
    except SettingError as error:
        raise BadInputError(str(error)) from error
    title = answers.title or "A room of {:g} x {:g} x {:g} m".format(*answers.room)
    return ExperimentSettings(title=title, information="operator", rig=_rig(answers), scene=scene)


def sensor_table(answers: Answers, corner_m: Vector3 = (0.0, 0.0, 0.0)) -> str:
    """The thermometers and anemometers as the CSV that a scene names; empty where there are none."""
    rows = [
        [*_moved(sensor.position, corner_m), sensor.temperature, sensor.temperature_deviation, "", "", "", ""]
        for sensor in answers.thermometer
    ]
    rows += [
        [*_moved(meter.position, corner_m), "", "", *meter.velocity, meter.deviation]
        for meter in answers.anemometer
    ]
    lines = [",".join(value if isinstance(value, str) else f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(["x,y,z,T,T_std,u,v,w,u_std", *lines, ""]) if rows else ""


def picture_on_wall_m(optics: Optics, room: Box) -> tuple[float, float]:
    """Width and height of the wall that the camera sees."""
    distance_m = room.upper_m[1] - optics.position_m[1]
    return optics.width_px * distance_m / optics.focal_px[0], optics.height_px * distance_m / optics.focal_px[
        1
    ]


def picture_told(scene: Scene) -> str:
    """How much of the patterned wall the camera sees, as a sentence."""
    width_m, height_m = picture_on_wall_m(scene.views[0].camera, scene.room)
    return (
        f"the camera sees {width_m:.2f} x {height_m:.2f} m of a wall of "
        f"{scene.room.size_m[0]:g} x {scene.room.size_m[2]:g} m."
    )


def _optics(camera: CameraAnswer, room: Box) -> Optics:
    """Straight at the patterned wall; from its middle where only the distance is told."""
    back_m = room.upper_m[1]
    if camera.position is None:
        position = (room.centre_m[0], back_m - (camera.distance or 0.0), room.centre_m[2])
    else:
        position = _moved(camera.position, room.lower_m)
    return _straight(position, camera.width_px, camera.height_px, _focal_px(camera))


def _moved(place_m: Vector3, corner_m: Vector3) -> Vector3:
    x, y, z = (value + corner for value, corner in zip(place_m, corner_m, strict=True))
    return x, y, z


def _straight(position_m: Vector3, width_px: int, height_px: int, focal_px: float) -> Optics:
    return looking_along_y(position_m=position_m, width_px=width_px, height_px=height_px, focal_px=focal_px)


def _focal_px(camera: CameraAnswer) -> float:
    if camera.angle_of_view is not None:
        return _focal_of_angle(camera.width_px, camera.angle_of_view)
    return (camera.focal_length or 0.0) / (camera.pixel_pitch or 1.0)


def _focal_of_angle(width_px: int, angle_deg: float) -> float:
    return 0.5 * width_px / math.tan(math.radians(angle_deg) / 2)


def _light(answers: Answers, camera: Optics, room: Box) -> Light:
    thrown = answers.projector
    if thrown is None:
        return suited_print(camera, room.upper_m[1] - camera.position_m[1], answers.pattern_seed)
    focal_px = _focal_of_angle(thrown.width_px, thrown.angle_of_view)
    projector = _straight(_moved(thrown.position, room.lower_m), thrown.width_px, thrown.height_px, focal_px)
    return projected(camera, projector, answers.pattern_seed)


def _rig(answers: Answers) -> RigSettings:
    camera, projector = answers.camera, answers.projector
    if camera.kind == "simulated":
        told = {"room": TRUTH_FILE} | ({} if camera.exposure is None else {"exposure_s": camera.exposure})
        device = SimulatedCameraSettings.model_validate(told)
    else:
        told = {
            "kind": camera.kind,
            "device": camera.device,
            "pixel_format": camera.pixel_format,
            "width_px": camera.width_px,
            "height_px": camera.height_px,
            "bits": camera.bits,
            "exposure_s": camera.exposure,
        }
        device = (AravisCameraSettings if camera.kind == "aravis" else V4l2CameraSettings).model_validate(
            told
        )
    spoken = ProjectorSettings(url=projector.url) if projector and projector.url else None
    return RigSettings(camera=device, projector=spoken)


def _boundary(answers: Answers, room: Box) -> list[BoundaryInformation]:
    inlets = [_inlet(item, room) for item in answers.supply]
    outlets = [
        Outlet(
            patch=_patch(item, room),
            mean_temperature_k=item.temperature,
            temperature_std_k=item.temperature_deviation,
        )
        for item in answers.outlet
    ]
    heaters = [
        Heater(
            patch=_patch(item, room),
            temperature_k=item.temperature,
            temperature_std_k=item.temperature_deviation,
        )
        for item in answers.surface
    ]
    sensors = [PointSensors(file=SENSORS_FILE)] if answers.thermometer or answers.anemometer else []
    return [*inlets, *outlets, *heaters, *_walls(answers), *sensors]


def _walls(answers: Answers) -> list[Wall]:
    told = {
        item.wall: Wall(
            wall=item.wall,
            thermal="adiabatic" if item.adiabatic else "temperature",
            temperature_k=item.temperature,
            temperature_std_k=item.temperature_deviation,
        )
        for item in answers.wall
    }
    return [told.get(name, Wall(wall=name)) for name in WALLS]


def object_of(item: ObjectAnswer, number: int, corner_m: Vector3 = (0.0, 0.0, 0.0)) -> RoomObject:
    """The box of one answer; `number` is its place among the answers. Raises SettingError."""
    name, foot_m = f"{item.kind.replace('_', ' ')} {number + 1}", _moved(item.position, corner_m)
    ready = ready_object(item.kind, name, foot_m, item.size)
    if item.temperature is not None:
        return replace(
            ready,
            thermal="temperature",
            power_w=None,
            temperature_k=item.temperature,
            temperature_std_k=item.temperature_deviation,
        )
    power_w = ready.power_w if item.heat is None else item.heat
    if power_w is None:
        return ready
    std_w = ready.power_std_w if item.heat_deviation is None else item.heat_deviation
    return replace(ready, thermal="power", power_w=power_w, power_std_w=std_w)


def _inlet(item: SupplyAnswer, room: Box) -> Inlet:
    patch = _patch(item, room)
    face = face_of(item.wall)
    speed_m_s = (item.speed or 0.0) if item.flow is None else item.flow / patch.area_m2
    velocity = [0.0, 0.0, 0.0]
    velocity[face.axis] = face.inward * speed_m_s
    return Inlet(
        patch=patch,
        temperature_k=item.temperature,
        temperature_std_k=item.temperature_deviation,
        velocity_m_s=(velocity[0], velocity[1], velocity[2]),
        velocity_std_m_s=item.deviation * speed_m_s,
    )


def _patch(item: OpeningAnswer, room: Box) -> Patch:
    """The rectangle, on its wall."""
    along = face_of(item.wall).along
    first, second = (room.lower_m[axis] for axis in along)
    return Patch(
        wall=item.wall,
        lower_m=(item.lower[0] + first, item.lower[1] + second),
        upper_m=(item.upper[0] + first, item.upper[1] + second),
    )
