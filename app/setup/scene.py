"""Answers to the scene and the rig that they describe. Raises BadInputError with the answer's name."""

from dataclasses import replace

from app.errors import BadInputError
from app.experiment.folder import ExperimentSettings
from app.experiment.rig_settings import ProjectorSettings, RigSettings
from app.setup.answers import Answers, ObjectAnswer, OpeningAnswer, SupplyAnswer
from app.setup.mistakes import contradictions, field_name
from app.setup.views import (
    addresses_of,
    device_of,
    devices_of,
    eye_of,
    further_lights,
    further_views,
    light_of,
    moved,
    view_of,
)
from core.air import Air
from core.geometry import WALLS, Box, Vector3, face_of
from core.objects import RoomObject, ready_object
from core.scene import (
    BoundaryInformation,
    Heater,
    Inlet,
    Outlet,
    Patch,
    PointSensors,
    Scene,
    Wall,
)
from core.setting import SettingError
from core.view_frame import facing

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
    room = Box(lower_m=corner_m, upper_m=moved(answers.room, corner_m))
    try:
        optics = eye_of(answers.camera, "y_max", room)
        cameras = (view_of(answers.camera, optics), *further_views(answers, room))
        scene = Scene(
            room=room,
            air=Air(ambient_temperature_k=answers.air),
            views=(*cameras, *further_lights(answers, room, cameras)),
            light=light_of(answers.projector, answers.pattern_seed, optics, "y_max", room),
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
        [*moved(sensor.position, corner_m), sensor.temperature, sensor.temperature_deviation, "", "", "", ""]
        for sensor in answers.thermometer
    ]
    rows += [
        [*moved(meter.position, corner_m), "", "", *meter.velocity, meter.deviation]
        for meter in answers.anemometer
    ]
    lines = [",".join(value if isinstance(value, str) else f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(["x,y,z,T,T_std,u,v,w,u_std", *lines, ""]) if rows else ""


def picture_on_wall_m(scene: Scene, view: int = 0) -> tuple[float, float]:
    """Width and height of what a view's camera sees of its wall."""
    framed, number = facing(scene, view)
    eye, room = framed.views[number].camera, framed.room
    distance_m = room.upper_m[1] - eye.position_m[1]
    return eye.width_px * distance_m / eye.focal_px[0], eye.height_px * distance_m / eye.focal_px[1]


def wall_m(scene: Scene, view: int = 0) -> tuple[float, float]:
    """Width and height of the wall that a view looks at, as its camera sees it."""
    framed, _ = facing(scene, view)
    return framed.room.size_m[0], framed.room.size_m[2]


def picture_told(scene: Scene, view: int = 0) -> str:
    """How much of its patterned wall a view's camera sees, as a sentence."""
    (width_m, height_m), (across_m, up_m) = picture_on_wall_m(scene, view), wall_m(scene, view)
    eye = scene.views[view]
    seen = "a wall" if eye.wall == "y_max" else f"the wall {eye.wall}"
    return f"the camera sees {width_m:.2f} x {height_m:.2f} m of {seen} of {across_m:g} x {up_m:g} m."


def _rig(answers: Answers) -> RigSettings:
    projector = answers.projector
    spoken = ProjectorSettings(url=projector.url) if projector and projector.url else None
    return RigSettings(
        camera=device_of(answers.camera),
        cameras=devices_of(answers.view) or None,
        projector=spoken,
        projectors=addresses_of(answers) or None,
    )


def _boundary(answers: Answers, room: Box) -> list[BoundaryInformation]:
    inlets = [_inlet(item, room) for item in answers.supply]
    outlets = [
        Outlet(
            patch=_patch(item, room),
            flow_m3_s=item.flow,
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
    name, foot_m = f"{item.kind.replace('_', ' ')} {number + 1}", moved(item.position, corner_m)
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
    speed_m_s = (item.speed or 0.0) if item.flow is None else item.flow / patch.area_m2
    return Inlet(
        patch=patch,
        temperature_k=item.temperature,
        temperature_std_k=item.temperature_deviation,
        velocity_m_s=face_of(item.wall).straight_in(speed_m_s),
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
