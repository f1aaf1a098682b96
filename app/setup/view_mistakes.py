"""What cannot be true of further cameras and projectors together with the first ones and the room."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.files.toml_errors import Said
from app.files.toml_places import Path
from app.setup.answers import FIRST, CameraAnswer, LightAnswer, ProjectorAnswer, ViewAnswer
from core.geometry import Vector3, WallName, face_of

Views = list[tuple[Path, ViewAnswer]]
Lights = list[tuple[Path, LightAnswer]]


def view_mistakes(parts: Mapping[Path, Any]) -> Iterator[Said]:
    """Every mistake of the views and lights among the parts, at its field; a part with one of its own is None."""
    views: Views = [(path, part) for path, part in parts.items() if path[0] == "view" and part is not None]
    lights: Lights = [(path, part) for path, part in parts.items() if path[0] == "light" and part is not None]
    yield from _names(views, lights)
    yield from _devices(parts.get(("camera",)), views)
    yield from _lights(views)
    if all(part is not None for path, part in parts.items() if path[0] == "view"):
        yield from _turns(("projector",) in parts, views, lights)
    yield from _addresses(parts.get(("projector",)), views, lights)
    yield from _behind(parts.get(("room",)), views, lights)


def _names(views: Views, lights: Lights) -> Iterator[Said]:
    """Captures and calibrations name cameras and further projectors alike."""
    taken = {FIRST: "camera"}
    for path, item in (*views, *lights):
        if item.name in taken:
            yield Said(
                (*path, "name"),
                f"another {taken[item.name]} is called {item.name!r}. Give each a name of its own.",
            )
        taken.setdefault(item.name, "camera" if path[0] == "view" else "projector")


def _devices(first: CameraAnswer | None, views: Views) -> Iterator[Said]:
    """Simulated are all cameras or none, and a real one is one view's."""
    taken = {} if first is None or first.kind == "simulated" else {first.device: FIRST}
    for path, item in views:
        if first is not None and (item.kind == "simulated") != (first.kind == "simulated"):
            expected = "simulated" if first.kind == "simulated" else "v4l2 or aravis"
            yield Said((*path, "kind"), f"the first camera is {first.kind}: expected {expected} here.")
        elif item.kind != "simulated" and item.device in taken:
            yield Said(
                (*path, "device"),
                f"{item.device} is the device of {taken[item.device]!r}. Give this camera its own.",
            )
        else:
            taken[item.device] = item.name


def _lights(views: Views) -> Iterator[Said]:
    """The first camera of a wall tells its pattern."""
    lit: dict[WallName, str] = {"y_max": FIRST}
    for path, item in views:
        if item.projector is not None and item.wall in lit:
            yield Said(
                (*path, "projector"),
                f"{item.wall} has the pattern of {lit[item.wall]!r}, which this camera sees as well. Leave the "
                "projector out; one that lights the wall in turn with another is a [[light]].",
            )
        lit.setdefault(item.wall, item.name)


def _turns(projected: bool, views: Views, lights: Lights) -> Iterator[Said]:
    """A further projector lights a wall that has one, before a camera that there is."""
    walls = _walls(views)
    lit: dict[WallName, bool] = {"y_max": projected}
    for _, item in views:
        lit.setdefault(item.wall, item.projector is not None)
    for path, item in lights:
        wall = walls.get(item.camera_of)
        if wall is None:
            known = ", ".join(repr(name) for name in walls)
            yield Said(
                (*path, "camera_of"), f"there is no camera {item.camera_of!r}; expected one of {known}."
            )
        elif not lit[wall]:
            yield Said(
                (*path, "camera_of"),
                f"a print hangs on {wall}, the wall of {item.camera_of!r}, and cannot be switched off while another "
                "projector lights it. Take the print down and answer a projector for that wall first, or leave this "
                "one out.",
            )


def _walls(views: Views) -> dict[str, WallName]:
    """The wall that each camera looks at."""
    walls: dict[str, WallName] = {FIRST: "y_max"}
    for _, item in views:
        walls[item.name] = item.wall
    return walls


def _addresses(first: ProjectorAnswer | None, views: Views, lights: Lights) -> Iterator[Said]:
    """A projector that is spoken to has a line of its own."""
    thrown = [(("projector",), first)] if first else []
    thrown += [((*path, "projector"), item.projector) for path, item in views if item.projector]
    taken: set[str] = set()
    for path, item in (*thrown, *lights):
        if item.url in taken:
            yield Said(
                (*path, "url"), f"another projector is spoken to at {item.url}. Give each its own address."
            )
        if item.url and not item.url.startswith("simulated:"):
            taken.add(item.url)


def _behind(room_m: Vector3 | None, views: Views, lights: Lights) -> Iterator[Said]:
    """Cameras and projectors that stand at or behind the wall that they look at."""
    walls = _walls(views)
    standing = [(path, item.wall, item.position) for path, item in views]
    standing += [
        ((*path, "projector"), item.wall, item.projector.position) for path, item in views if item.projector
    ]
    standing += [
        (path, walls[item.camera_of], item.position) for path, item in lights if item.camera_of in walls
    ]
    for path, wall, at in standing if room_m else ():
        face = face_of(wall)
        wall_m = (room_m or ())[face.axis] if face.upper else 0.0
        letter = "xyz"[face.axis]
        if at is not None and face.inward * (at[face.axis] - wall_m) <= 0:
            yield Said(
                (*path, "position", face.axis),
                f"{letter} is {at[face.axis]:g} m, at or behind the wall {wall} at {letter} = {wall_m:g} m. "
                f"It stands before its wall: give a {'smaller' if face.upper else 'larger'} {letter}.",
            )
