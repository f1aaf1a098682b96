"""From a room volume to a scene: the rig that looks at it, and what an operator would know of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.errors import BadInputError
from app.files.durable import durable_path
from app.volume.file import RoomVolume
from core.air import GAS_CONSTANT_DRY_AIR_J_KG_K, Air
from core.geometry import WALLS, Box, Optics, Vector2, Vector3, WallName, face_of, looking_along_y
from core.objects import RoomObject
from core.plan.print_choice import suited_print
from core.scene import (
    BoundaryInformation,
    CameraNoise,
    FixedTexture,
    Heater,
    Inlet,
    Light,
    Marks,
    Outlet,
    Patch,
    PlaneField,
    ProjectedPattern,
    Scene,
    View,
    Wall,
    WaveletPattern,
)
from core.view_frame import turn_to

Information = Literal["paper", "operator", "surveyed"]
RigName = Literal["paper", "lab"]

# The camera sees this much of the wall beyond the room on each side: a border that no flow moves.
BORDER = 0.03
# Two windows, and the gradient's reach at the picture's edge.
BORDER_PX = 36
# A board near the camera: its share of the picture's width and height.
_BOARD = (0.16, 0.12)
PLANE_FILE = "boundary/plane_x_min.npz"

_WALLS: dict[str, WallName] = {
    "xMinWall": "x_min",
    "xMaxWall": "x_max",
    "front": "y_min",
    "back": "y_max",
    "floor": "z_min",
    "ceiling": "z_max",
}


# Stand-off, and projector minus camera (x, z): the publication's, and the one that `bench placement` recommends.
RIG_PLACES: Mapping[RigName, tuple[float, Vector2]] = {"paper": (30.5, (1.0, 0.0)), "lab": (4.0, (1.0, 1.0))}


@dataclass(frozen=True)
class RigOptions:
    """The rig to simulate. Lengths in metres; `baseline_m` is projector minus camera (x, z).

    The picture reaches `border_px` beyond the wall at least, which windows need and single pixels do not. `walls` are
    patterned, each with a camera before it, and with a print or projector of its own. With `marks`, two still boards
    near each camera stand in the upper corners of its picture. `further_projectors_m` light the first wall in turn
    with the first projector, for the same camera: minus camera (x, z), as `baseline_m`.
    """

    camera_px: tuple[int, int] = (4096, 3072)
    light: Literal["texture", "projector"] = "texture"
    frames: int = 100
    full_well_e: float = 10_000.0
    stand_off_m: float = RIG_PLACES["paper"][0]
    baseline_m: Vector2 = RIG_PLACES["paper"][1]
    projector_px: tuple[int, int] = (1920, 1200)
    pattern_seed: int = 0
    border_px: int = BORDER_PX
    walls: tuple[WallName, ...] = ("y_max",)
    marks: bool = False
    further_projectors_m: tuple[Vector2, ...] = ()

    def __post_init__(self) -> None:
        if self.frames < 1 or self.full_well_e <= 0 or min(self.camera_px) < 16:
            raise BadInputError(
                f"frames {self.frames}, full well {self.full_well_e:g} e-, camera {self.camera_px} px: expected "
                "at least 1 frame, a positive full well, and a camera of 16 x 16 px or more."
            )
        if not self.walls or len(set(self.walls)) < len(self.walls):
            raise BadInputError(
                f"The views look at {', '.join(self.walls) or 'no wall'}; expected each wall once, and one at least."
            )
        if self.further_projectors_m and self.light != "projector":
            raise BadInputError(
                "A further projector lights the wall in turn with a first one, and this wall has a print. Take the "
                "light 'projector'."
            )


def parse_walls(text: str) -> tuple[WallName, ...]:
    """'y,x' or 'y_max,x_max' to names of walls. Raises BadInputError."""
    known: dict[str, WallName] = {"x": "x_max", "y": "y_max", "z": "z_max"}
    known.update((wall, wall) for wall in WALLS)
    names = [part.strip() for part in text.split(",")]
    if not set(names) <= set(known):
        raise BadInputError(
            f"The views are {text!r}; expected walls with commas between them, such as y,x or y_max,x_min,z_max: "
            f"{', '.join(WALLS)}."
        )
    return tuple(known[name] for name in names)


def room_scene(volume: RoomVolume, options: RigOptions, information: Information) -> Scene:
    """The scene that `information` lets an operator write down. Raises BadInputError, SettingError."""
    room = room_box(volume)
    if options.stand_off_m <= 0:
        raise BadInputError(
            f"The stand-off is {options.stand_off_m:g} m; expected the distance from camera to back wall, "
            "above 0."
        )
    views = tuple(_view(room, options, number) for number in range(len(options.walls)))
    views += tuple(_in_turn(room, views[0], options, n) for n in range(len(options.further_projectors_m)))
    # A view of another wall has its own light; the scene's is then nobody's.
    light = views[0].light or _light(room, views[0].camera, options)
    return Scene(
        room=room,
        air=_air(volume),
        views=views,
        light=light if views[0].wall == "y_max" or light.kind == "texture" else FixedTexture(),
        boundary=tuple(known_boundary(volume, information)),
        objects=room_objects(volume),
    )


def _view(room: Box, options: RigOptions, number: int) -> View:
    """The camera before one of the walls; one that does not look at y_max has a light of its own."""
    wall = options.walls[number]
    turn = turn_to(wall)
    facing_it = turn.box(room)
    camera = _covering(facing_it, options.camera_px, options.border_px, options.stand_off_m, (0.0, 0.0))
    light = None
    if wall != "y_max":
        own = replace(options, pattern_seed=options.pattern_seed + number)
        light = _light(facing_it, camera, own)
        if isinstance(light, ProjectedPattern):
            light = replace(light, projector=turn.back().optics(light.projector))
        camera = turn.back().optics(camera)
    return View(
        name="camera" if number == 0 else f"camera at {wall}",
        camera=camera,
        wall=wall,
        light=light,
        noise=CameraNoise(full_well_e=options.full_well_e),
        frames=options.frames,
        marks=_boards(options.camera_px) if options.marks else (),
    )


def _in_turn(room: Box, first: View, options: RigOptions, number: int) -> View:
    """The first view under a further projector, which throws another pattern."""
    turn = turn_to(first.wall)
    seed = options.pattern_seed + len(options.walls) + number
    own = replace(options, baseline_m=options.further_projectors_m[number], pattern_seed=seed)
    light = _light(turn.box(room), turn.optics(first.camera), own)
    if isinstance(light, ProjectedPattern) and not turn.is_none:
        light = replace(light, projector=turn.back().optics(light.projector))
    return replace(first, name=f"{first.name}, light {number + 2}", light=light, camera_of=first.name)


def _boards(size_px: tuple[int, int]) -> tuple[Marks, ...]:
    width, height = (share * length for share, length in zip(_BOARD, size_px, strict=True))
    last = size_px[0] - 1.0
    return (
        Marks(name="left board", lower_px=(0.0, 0.0), upper_px=(width, height)),
        Marks(name="right board", lower_px=(last - width, 0.0), upper_px=(last, height)),
    )


def room_box(volume: RoomVolume) -> Box:
    """The box that the volume's vertices span."""
    axes = (volume.x_m, volume.y_m, volume.z_m)
    x, y, z = ((_round(axis[0]), _round(axis[-1])) for axis in axes)
    return Box(lower_m=(x[0], y[0], z[0]), upper_m=(x[1], y[1], z[1]))


def room_objects(volume: RoomVolume) -> tuple[RoomObject, ...]:
    """What stands in the room, as the volume's case lists it: everybody in the room sees that."""
    return tuple(_object(item, volume) for item in volume.case.get("obstacles", []))


def _object(item: dict[str, Any], volume: RoomVolume) -> RoomObject:
    room = room_box(volume)
    lower, upper = (
        [
            min(max(_round(v), low), high)
            for v, low, high in zip(item[key], room.lower_m, room.upper_m, strict=True)
        ]
        for key in ("lower", "upper")
    )
    kind = item.get("thermal", "adiabatic")
    return RoomObject(
        name=str(item["name"]),
        lower_m=(lower[0], lower[1], lower[2]),
        upper_m=(upper[0], upper[1], upper[2]),
        thermal=kind,
        temperature_k=float(item["temperature_K"]) if kind == "temperature" else None,
        power_w=float(item["power_W"]) if kind == "power" else None,
    )


def known_boundary(volume: RoomVolume, information: Information) -> list[BoundaryInformation]:
    """What the level of information tells: `paper` the plane, `operator` patches and walls, `surveyed` all."""
    known: list[BoundaryInformation] = []
    if information in ("paper", "surveyed"):
        known.append(PlaneField(file=PLANE_FILE))
    if information in ("operator", "surveyed"):
        if not volume.case:
            raise BadInputError(
                f"The volume does not describe its inlets and walls (no case in meta_json), which "
                f"--information {information} needs. Use --information paper."
            )
        known += [_inlet(inlet, volume) for inlet in volume.case.get("inlets", [])]
        known += _outlets(volume)
        known += [_wall(name, wall, volume, information) for name, wall in _WALLS.items()]
    if information == "surveyed" and volume.case.get("heater"):
        known.append(heater_of(volume))
    return known


def write_plane(folder: Path, volume: RoomVolume) -> Path:
    """T, p, u of the plane x = x_min, as `PlaneField` names it."""
    path = folder / PLANE_FILE
    with durable_path(path) as temporary:
        np.savez_compressed(
            temporary,
            y=volume.y_m,
            z=volume.z_m,
            T=volume.temperature_k[0],
            p=volume.pressure_m2_s2[0],
            u=volume.velocity_m_s[0],
        )
    return path


def _air(volume: RoomVolume) -> Air:
    """Air with the volume's own density and Gladstone-Dale coefficient."""
    return Air(
        pressure_pa=volume.density_kg_m3 * GAS_CONSTANT_DRY_AIR_J_KG_K * volume.ambient_k,
        ambient_temperature_k=volume.ambient_k,
        gladstone_dale=volume.gladstone_dale_m3_kg,
        kinematic_viscosity_m2_s=float(volume.scalars.get("nu", 1.5e-5)),
        prandtl=float(volume.scalars.get("Pr", 0.71)),
    )


def _covering(
    room: Box, size_px: tuple[int, int], border_px: int, stand_off_m: float, baseline_m: Vector2
) -> Optics:
    """Optics at the stand-off whose panel covers the back wall and a border; shifted like a lens, not tilted."""
    centre = room.centre_m
    border = max(BORDER, border_px / size_px[0])
    width, height = (room.size_m[axis] * (1 + 2 * border) for axis in (0, 2))
    focal_px = stand_off_m * min(size_px[0] / width, size_px[1] / height)
    position: Vector3 = (
        centre[0] + baseline_m[0],
        room.upper_m[1] - stand_off_m,
        centre[2] + baseline_m[1],
    )
    # The wall's centre stays at the panel's centre: to the left of a projector that stands to the right.
    principal = (
        (size_px[0] - 1) / 2 + focal_px * baseline_m[0] / stand_off_m,
        (size_px[1] - 1) / 2 - focal_px * baseline_m[1] / stand_off_m,
    )
    return looking_along_y(
        position_m=position,
        width_px=size_px[0],
        height_px=size_px[1],
        focal_px=focal_px,
        principal_px=principal,
    )


def _light(room: Box, camera: Optics, options: RigOptions) -> Light:
    if options.light == "texture":
        return suited_print(camera, options.stand_off_m, options.pattern_seed)
    projector = _covering(
        room, options.projector_px, options.border_px, options.stand_off_m, options.baseline_m
    )
    return projected(camera, projector, options.pattern_seed)


def projected(camera: Optics, projector: Optics, seed: int) -> ProjectedPattern:
    """The pattern to project: the finest band is at least 2 projector pixels and at least 3 camera pixels."""
    magnification = camera.focal_px[0] / projector.focal_px[0]
    finest = max(2.0, 3.0 / magnification)
    return ProjectedPattern(pattern=WaveletPattern(seed=seed, finest_px=finest), projector=projector)


def _inlet(inlet: dict[str, Any], volume: RoomVolume) -> Inlet:
    patch = _patch(inlet)
    return Inlet(
        patch=patch,
        temperature_k=volume.ambient_k + float(inlet["dT"]),
        velocity_m_s=face_of(patch.wall).straight_in(float(inlet["U"])),
        turbulence_intensity=float(volume.case.get("TI", 0.1)),
        length_scale_m=_length_scale_m(inlet, volume),
    )


def _length_scale_m(inlet: dict[str, Any], volume: RoomVolume) -> float | None:
    """A case states it as a share of the patch's hydraulic diameter, as CFD programs' users do."""
    share = volume.case.get("lscale")
    return None if share is None else float(share) * _patch(inlet).hydraulic_diameter_m


def _outlets(volume: RoomVolume) -> list[Outlet]:
    one = volume.case.get("outlet")
    patches = [_patch(box) for box in volume.case.get("outlets") or ([one] if one else [])]
    return [Outlet(patch=patch, mean_temperature_k=_leaving_k(volume, patch)) for patch in patches]


def _leaving_k(volume: RoomVolume, patch: Patch) -> float:
    """Temperature of what leaves by a patch: the mean of the air one vertex before it, weighted by outflow.

    Not on the patch itself: near its rim a vertex shows a part of the wall's temperature.
    """
    lower, upper, face = patch.lower_m, patch.upper_m, face_of(patch.wall)
    axes = (volume.x_m, volume.y_m, volume.z_m)
    inside = np.ix_(*(
        (axes[a] >= low_m - 1e-6) & (axes[a] <= high_m + 1e-6)
        for a, low_m, high_m in zip(face.along, lower, upper, strict=True)
    ))  # fmt: skip
    air_k = np.take(volume.temperature_k, face.before, face.axis)[inside].astype(np.float64)
    if air_k.size == 0:
        raise BadInputError(
            f"The outlet {lower} to {upper} m on {patch.wall} lies between the volume's vertices; "
            "resample the volume on a finer grid."
        )
    through_m_s = np.take(volume.velocity_m_s[..., face.axis], face.end, face.axis)[inside]
    leaving = np.maximum(-face.inward * through_m_s.astype(np.float64), 0.0)
    return float(np.average(air_k, weights=leaving if leaving.any() else None))


def _wall(name: str, wall: WallName, volume: RoomVolume, information: Information) -> Wall:
    if information == "operator":
        return Wall(wall=wall)
    if name in volume.case.get("adiabatic_walls", []):
        return Wall(wall=wall, thermal="adiabatic")
    given = volume.case.get("wall_T") or {}
    if name in given:
        return Wall(wall=wall, thermal="temperature", temperature_k=float(given[name]))
    if name in volume.case.get("isothermal_walls", []):
        return Wall(wall=wall, thermal="temperature", temperature_k=volume.ambient_k)
    return Wall(wall=wall)


def heater_of(volume: RoomVolume) -> Heater:
    """The heated panel of the floor that the volume's case names."""
    heater = volume.case["heater"]
    x, y = heater["x"], heater["y"]
    return Heater(
        patch=Patch(wall="z_min", lower_m=(float(x[0]), float(y[0])), upper_m=(float(x[1]), float(y[1]))),
        temperature_k=volume.ambient_k + float(heater["dT"]),
    )


def _patch(box: dict[str, Any]) -> Patch:
    name = str(box.get("wall", "xMinWall"))
    if name not in _WALLS:
        raise BadInputError(
            f"An opening of the volume's case stands on {name!r}; expected one of {', '.join(_WALLS)}."
        )
    first, second = ("xyz"[axis] for axis in face_of(_WALLS[name]).along)
    if first not in box or second not in box:
        raise BadInputError(
            f"An opening of the volume's case on {name} has no span along {first} and {second}; expected "
            f"{first} = [lower, upper] and {second} = [lower, upper] in metres."
        )
    (a, b), (c, d) = box[first], box[second]
    return Patch(wall=_WALLS[name], lower_m=(float(a), float(c)), upper_m=(float(b), float(d)))


def _round(value: float) -> float:
    """Float32 coordinates as a person wrote them."""
    return round(float(value), 6)
