"""Every mistake in answers at its field: for a file (line and column) and for the service (the field's name).

A part with a mistake of its own is left out of the comparisons with others, so that one slip is told once.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import combinations
from typing import Any

from pydantic import ValidationError

from app.files.toml import adapter_of
from app.files.toml_errors import Said, said_of
from app.files.toml_places import Path
from app.setup.answers import (
    AnemometerAnswer,
    Answers,
    CameraAnswer,
    LightAnswer,
    ObjectAnswer,
    OpeningAnswer,
    OutletAnswer,
    ProjectorAnswer,
    SupplyAnswer,
    SurfaceAnswer,
    ThermometerAnswer,
    ViewAnswer,
    WallAnswer,
)
from app.setup.units import LENS, Size
from app.setup.view_mistakes import view_mistakes
from core.geometry import Box, Vector3, face_of
from core.objects import RoomObject, ready_object, shared_m
from core.scene import Patch, stands_before

# Faster than any supply of a room.
FASTEST_M_S = 50.0
# Pixels of sensors, with room on both sides.
_PITCH_M = (1e-7, 1e-4)
_ONES: dict[str, Any] = {
    "room": tuple[Size, Size, Size],
    "camera": CameraAnswer,
    "projector": ProjectorAnswer,
}
_LISTS: dict[str, Any] = {
    "view": ViewAnswer,
    "light": LightAnswer,
    "supply": SupplyAnswer,
    "outlet": OutletAnswer,
    "surface": SurfaceAnswer,
    "wall": WallAnswer,
    "object": ObjectAnswer,
    "thermometer": ThermometerAnswer,
    "anemometer": AnemometerAnswer,
}
# Each part of the answers by its path, `("room",)`, `("supply", 0)`; None where it has a mistake of its own.
Parts = Mapping[Path, Any]


def mistakes_in(data: Mapping[str, Any]) -> list[Said]:
    """Every mistake in answers as they were written; empty where they describe an experiment."""
    try:
        answers = adapter_of(Answers).validate_json(_json(data), strict=True)
    except ValidationError as error:
        # How many supplies and outlets there are can be told of those that are wrong too.
        trapped = _trapped_air(*(_count(data.get(name)) for name in ("supply", "outlet")))
        return [*said_of(error, data, Answers), *trapped, *_contradictions(_written_parts(data))]
    return contradictions(answers)


def contradictions(answers: Answers) -> list[Said]:
    """What cannot be true of sound answers together."""
    return [*_trapped_air(len(answers.supply), len(answers.outlet)), *_contradictions(_parts_of(answers))]


def _count(items: Any) -> int:
    return len(items) if isinstance(items, list) else 0


def _json(value: Any) -> str:
    """A date, which TOML has and JSON has not, is told as a text that is no value."""
    return json.dumps(value, default=str)


def field_name(path: Path) -> str:
    """A path as a person reads it: `supply[0].flow`."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")


def _parts_of(answers: Answers) -> Parts:
    """The parts of sound answers."""
    ones: dict[Path, Any] = {
        (name,): getattr(answers, name) for name in _ONES if getattr(answers, name) is not None
    }
    lists: dict[Path, Any] = {
        (name, n): item for name in _LISTS for n, item in enumerate(getattr(answers, name))
    }
    return ones | lists


def _contradictions(parts: Parts) -> list[Said]:
    checks: tuple[Callable[[Parts], Iterator[Said]], ...] = (
        _off_its_wall,
        _overlaps,
        _too_fast,
        _no_lens,
        _nothing_left,
        _behind_the_wall,
        _outside_the_room,
        _objects_outside,
        _objects_apart,
        _objects_before_openings,
        _wall_twice,
        view_mistakes,
    )
    return [said for check in checks for said in check(parts)]


def _written_parts(data: Mapping[str, Any]) -> Parts:
    written: dict[Path, tuple[Any, Any]] = {
        (name,): (data[name], kind) for name, kind in _ONES.items() if name in data
    }
    for name, kind in _LISTS.items():
        items = data.get(name)
        written |= {(name, n): (v, kind) for n, v in enumerate(items if isinstance(items, list) else [])}
    found: dict[Path, Any] = {}
    for path, (value, kind) in written.items():
        try:
            found[path] = adapter_of(kind).validate_json(_json(value), strict=True)
        except ValidationError:
            found[path] = None
    return found


def _named(parts: Parts, *names: str) -> list[tuple[Path, Any]]:
    return [(path, part) for path, part in parts.items() if path[0] in names and part is not None]


def _openings(parts: Parts) -> list[tuple[Path, OpeningAnswer]]:
    return _named(parts, "supply", "outlet", "surface")


def _off_its_wall(parts: Parts) -> Iterator[Said]:
    room_m: Vector3 | None = parts.get(("room",))
    for path, item in _openings(parts):
        along = face_of(item.wall).along
        for number, axis in enumerate(along):
            low_m, high_m, letter = item.lower[number], item.upper[number], "xyz"[axis]
            if low_m >= high_m:
                told = (
                    f"lower is {low_m:g} m and upper {high_m:g} m along {letter}; lower is the smaller one."
                )
                yield Said((*path, "upper", number), told)
            elif room_m and (low_m < -1e-9 or high_m > room_m[axis] + 1e-9):
                yield Said(
                    (*path, "lower" if low_m < -1e-9 else "upper", number),
                    f"{low_m:g} to {high_m:g} m along {letter} is not on {item.wall}, which is 0 to "
                    f"{room_m[axis]:g} m long there.{_millimetres(high_m, room_m[axis])} A rectangle on "
                    f"{item.wall} is given along {'xyz'[along[0]]}, then {'xyz'[along[1]]}.",
                )


def _millimetres(value_m: float, length_m: float) -> str:
    """A question, where a number is too large by a factor that only a wrong unit makes."""
    return f" Are these millimetres ({value_m:g} mm)?" if value_m > 10 * length_m else ""


def _overlaps(parts: Parts) -> Iterator[Said]:
    for (path, one), (later, other) in combinations(_openings(parts), 2):
        shared_m = [
            min(h1, h2) - max(l1, l2)
            for l1, h1, l2, h2 in zip(one.lower, one.upper, other.lower, other.upper, strict=True)
        ]
        if one.wall == other.wall and min(shared_m) > 1e-9:
            yield Said(
                later,
                f"it overlaps {path[0]} {int(path[1]) + 1} on {one.wall}. A place on a wall is a supply, an "
                "outlet or a surface: move one of them.",
            )


def _trapped_air(supplies: int, outlets: int) -> Iterator[Said]:
    if bool(supplies) != bool(outlets):
        yield Said(
            ("supply",) if supplies else ("outlet",),
            f"there are {supplies} supplies and {outlets} outlets: air that comes in must leave, and air "
            "that leaves must come in. Give at least one of both (supply, outlet), or none.",
        )


def _too_fast(parts: Parts) -> Iterator[Said]:
    for path, item in _named(parts, "supply"):
        area_m2 = _area_m2(item)
        if area_m2 > 0 and item.flow is not None and item.flow / area_m2 > FASTEST_M_S:
            yield Said(
                (*path, "flow"),
                f"{3600 * item.flow:g} m3/h through {area_m2:g} m2 is {item.flow / area_m2:.3g} m/s; air comes into "
                f"a room slower than {FASTEST_M_S:g} m/s. Are the unit and the size of the opening right?",
            )


def _no_lens(parts: Parts) -> Iterator[Said]:
    """Lenses whose two lengths make an angle of view that no lens has; it is told at the one that looks wrong."""
    for path, item in _named(parts, "camera", "view"):
        if item.focal_length is None or item.pixel_pitch is None:
            continue
        across_px = max(item.width_px, item.height_px)
        angle_deg = 2 * math.degrees(math.atan2(across_px * item.pixel_pitch, 2 * item.focal_length))
        if not LENS.low <= angle_deg <= LENS.high:
            plausible = _PITCH_M[0] <= item.pixel_pitch <= _PITCH_M[1]
            yield Said(
                (*path, "focal_length" if plausible else "pixel_pitch"),
                f"{across_px} pixels, {1e6 * item.pixel_pitch:g} um from one to the next, behind a lens of "
                f"{1e3 * item.focal_length:g} mm see {angle_deg:.3g} degrees. {LENS.advice} Are both units right?",
            )


def _nothing_left(parts: Parts) -> Iterator[Said]:
    """Outlets whose flows leave nothing to one without a flow."""
    outlets, supplies = _named(parts, "outlet"), _named(parts, "supply")
    flows_m3_s = [item.flow for _, item in outlets if item.flow is not None]
    supplied_m3_s = sum(
        item.speed * _area_m2(item) if item.flow is None else item.flow for _, item in supplies
    )
    for path, item in outlets if flows_m3_s and supplies else ():
        if item.flow is None and sum(flows_m3_s) >= supplied_m3_s:
            yield Said(
                (*path, "flow"),
                f"the other outlets take {3600 * sum(flows_m3_s):g} m3/h and the supplies bring "
                f"{3600 * supplied_m3_s:g} m3/h, so nothing is left for this one. Correct the flows, or give that of "
                "every outlet.",
            )


def _area_m2(item: OpeningAnswer) -> float:
    return (item.upper[0] - item.lower[0]) * (item.upper[1] - item.lower[1])


def _behind_the_wall(parts: Parts) -> Iterator[Said]:
    room_m: Vector3 | None = parts.get(("room",))
    for path, item in _named(parts, "camera", "projector"):
        if room_m and item.position is not None and item.position[1] >= room_m[1]:
            yield Said(
                (*path, "position", 1),
                f"y is {item.position[1]:g} m, at or behind the patterned wall at y = {room_m[1]:g} m. "
                f"The {path[0]} stands before it: give a smaller y (below 0 is before the room).",
            )


def _outside_the_room(parts: Parts) -> Iterator[Said]:
    room_m: Vector3 | None = parts.get(("room",))
    for path, item in _named(parts, "thermometer", "anemometer") if room_m else ():
        for axis, (place_m, length_m) in enumerate(zip(item.position, room_m or (), strict=True)):
            if not 0 <= place_m <= length_m:
                yield Said(
                    (*path, "position", axis),
                    f"{place_m:g} m along {'xyz'[axis]} is outside the room, which is 0 to {length_m:g} m there."
                    f"{_millimetres(place_m, length_m)} Places are measured from the room's corner.",
                )


def _boxes(parts: Parts) -> list[tuple[Path, RoomObject]]:
    return [
        (path, ready_object(item.kind, item.kind, item.position, item.size))
        for path, item in _named(parts, "object")
    ]


def _objects_outside(parts: Parts) -> Iterator[Said]:
    """Objects that reach through a wall, or are larger than the room."""
    room_m: Vector3 | None = parts.get(("room",))
    for path, box in _boxes(parts) if room_m else ():
        for axis, length_m in enumerate(room_m or ()):
            low_m, high_m, letter = box.lower_m[axis], box.upper_m[axis], "xyz"[axis]
            if box.size_m[axis] > length_m + 1e-9:
                field = ("kind",) if parts[path].size is None else ("size", axis)
                yield Said(
                    (*path, *field),
                    f"it is {box.size_m[axis]:g} m long along {letter}, more than the room's {length_m:g} m."
                    f"{_millimetres(box.size_m[axis], length_m)}",
                )
            elif low_m < -1e-9 or high_m > length_m + 1e-9:
                yield Said(
                    (*path, "position", axis),
                    f"it reaches from {low_m:g} to {high_m:g} m along {letter}; the room is 0 to {length_m:g} m "
                    f"there.{_millimetres(high_m, length_m)} `position` is the middle of its foot.",
                )


def _objects_apart(parts: Parts) -> Iterator[Said]:
    """Objects that reach into one another."""
    for (path, one), (later, other) in combinations(_boxes(parts), 2):
        if min(shared_m(one, other)) > 1e-9:
            yield Said(later, f"it stands in {path[0]} {int(path[1]) + 1}. Move one of them.")


def _objects_before_openings(parts: Parts) -> Iterator[Said]:
    """Objects that stand against a supply or an outlet."""
    room_m: Vector3 | None = parts.get(("room",))
    if room_m is None:
        return
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=room_m)
    for path, box in _boxes(parts):
        for place, item in _named(parts, "supply", "outlet"):
            sound = all(low < high for low, high in zip(item.lower, item.upper, strict=True))
            if sound and stands_before(
                box, Patch(wall=item.wall, lower_m=item.lower, upper_m=item.upper), room
            ):
                yield Said(
                    path,
                    f"it stands against {place[0]} {int(place[1]) + 1} on {item.wall}, so no air can pass there. "
                    "Move one of them.",
                )


def _wall_twice(parts: Parts) -> Iterator[Said]:
    seen: set[str] = set()
    for path, item in _named(parts, "wall"):
        if item.wall in seen:
            yield Said((*path, "wall"), f"{item.wall} is answered twice. Say one thing about a wall.")
        seen.add(item.wall)
