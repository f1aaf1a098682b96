"""What cannot be true of further cameras together with the first one and the room."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.files.toml_errors import Said
from app.files.toml_places import Path
from app.setup.answers import CameraAnswer, ViewAnswer
from core.geometry import Vector3, WallName, face_of

# What the first camera is called, which `camera` answers.
FIRST = "camera"


def view_mistakes(parts: Mapping[Path, Any]) -> Iterator[Said]:
    """Every mistake of the sound views among the parts, at its field."""
    views = [(path, part) for path, part in parts.items() if path[0] == "view"]
    yield from _names(views)
    yield from _devices(parts.get(("camera",)), views)
    yield from _lights(views)
    yield from _behind(parts.get(("room",)), views)


def _names(views: list[tuple[Path, ViewAnswer]]) -> Iterator[Said]:
    taken = {FIRST}
    for path, item in views:
        if item.name in taken:
            yield Said(
                (*path, "name"), f"another camera is called {item.name!r}. Give each a name of its own."
            )
        taken.add(item.name)


def _devices(first: CameraAnswer | None, views: list[tuple[Path, ViewAnswer]]) -> Iterator[Said]:
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


def _lights(views: list[tuple[Path, ViewAnswer]]) -> Iterator[Said]:
    """One wall has one pattern, and only the first projector is spoken to."""
    lit: dict[WallName, str] = {"y_max": FIRST}
    for path, item in views:
        if item.projector is not None and item.wall in lit:
            yield Said(
                (*path, "projector"),
                f"{item.wall} has the pattern of {lit[item.wall]!r}, which this camera sees as well. Leave the "
                "projector out.",
            )
        elif item.projector is not None and item.projector.url:
            yield Said(
                (*path, "projector", "url"),
                "only the first camera's projector is spoken to. Leave the address empty and switch this one by "
                "hand.",
            )
        lit.setdefault(item.wall, item.name)


def _behind(room_m: Vector3 | None, views: list[tuple[Path, ViewAnswer]]) -> Iterator[Said]:
    """Cameras and projectors that stand at or behind the wall that they look at."""
    for path, item in views if room_m else ():
        face = face_of(item.wall)
        wall_m = (room_m or ())[face.axis] if face.upper else 0.0
        letter = "xyz"[face.axis]
        for name, place, at in (
            (item.name, (), item.position),
            ("projector", ("projector",), item.projector and item.projector.position),
        ):
            if at is not None and face.inward * (at[face.axis] - wall_m) <= 0:
                yield Said(
                    (*path, *place, "position", face.axis),
                    f"{letter} is {at[face.axis]:g} m, at or behind the wall {item.wall} at {letter} = {wall_m:g} m. "
                    f"The {name} stands before it: give a {'smaller' if face.upper else 'larger'} {letter}.",
                )
