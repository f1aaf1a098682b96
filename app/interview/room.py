"""What is asked about the room: its size, what blows, warms and cools in it, what stands in it, what measures."""

import copy
from collections.abc import Callable

from app.files.toml_places import Path
from app.interview.ask import (
    Asked,
    ask_choice,
    ask_count,
    ask_either,
    ask_field,
    ask_position,
    ask_temperature,
)
from app.interview.conversation import Again
from app.interview.objects import ask_object
from app.interview.tree import Tree, put, sentence_at, value_at
from core.geometry import WALLS, face_of

WALL_WORDS = {
    "x_min": "left",
    "x_max": "right",
    "y_min": "front",
    "y_max": "patterned",
    "z_min": "floor",
    "z_max": "ceiling",
}
_CORNERS = {"lower": ["1 m", "1 m"], "upper": ["1.5 m", "1.2 m"]}
# What one more thing of a kind begins as.
_FRESH: dict[str, Tree] = {
    "supply": {"wall": "x_min", **_CORNERS, "flow": "100 m3/h", "temperature": "20 C"},
    "outlet": {"wall": "x_max", **_CORNERS},
    "surface": {"wall": "x_max", "lower": ["1 m", "0.2 m"], "upper": ["2 m", "0.8 m"], "temperature": "40 C"},
    "wall": {"wall": "z_max", "temperature": "20 C"},
    "object": {"kind": "seated_person", "position": ["1 m", "1 m", "0 m"]},
    "thermometer": {"position": ["1 m", "1 m", "1 m"], "temperature": "20 C"},
    "anemometer": {"position": ["1 m", "1 m", "1 m"], "velocity": ["0.1 m/s", "0 m/s", "0 m/s"]},
}
_DEVIATIONS = {
    "supply": "0.3 K",
    "outlet": "0.3 K",
    "surface": "0.5 K",
    "wall": "0.3 K",
    "thermometer": "0.2 K",
}
_COUNTED = {
    "supply": "How many supplies blow air in",
    "outlet": "How many outlets let air out",
    "surface": "How many warm or cold surfaces (radiators, windows)",
    "wall": "How many whole walls of which something is known",
    "object": "How many people and pieces of furniture stand in the room",
    "thermometer": "How many thermometers in the air",
    "anemometer": "How many anemometers in the air",
}


def ask_room(tree: Tree) -> Asked:
    """Ask for the room, then for each thing in it."""
    yield from ask_field(tree, ("title",), "Name of the experiment")
    for axis, name in enumerate(("Length along x", "Depth along y", "Height along z")):
        yield from ask_field(tree, ("room", axis), name, "m")
    yield from ask_field(tree, ("air",), "Still air, at the reference", "C")
    for kind in _COUNTED:
        yield from _ask_things(tree, kind)


def _ask_things(tree: Tree, kind: str) -> Asked:
    there = tree.get(kind, [])
    # Air that comes in must leave: it is known to do so once supplies and outlets are both counted.
    with_this = (("supply",),) if kind == "outlet" else ()
    count = yield from ask_count(tree, _COUNTED[kind], len(there), (kind,), *with_this)
    more = [copy.deepcopy(_FRESH[kind]) for _ in range(count - len(there))]
    tree[kind] = [*there[:count], *more]
    for number in range(count):
        asked = yield from counting(_ASK[kind](tree, kind, (kind, number), f"{kind} {number + 1}"))
        wrong = sentence_at(tree, (kind, number))
        if wrong:
            yield Again(wrong, asked)
    if not count:
        del tree[kind]


def counting(asking: Asked) -> Asked:
    """Ask the same; return how many questions that were."""
    asked, answer = 0, None
    try:
        item = next(asking)
        while True:
            answer = yield item
            asked += 1
            item = asking.send(answer)
    except StopIteration:
        return asked


def _ask_opening(tree: Tree, path: Path, name: str) -> Asked:
    yield from _ask_wall(tree, path, name)
    along = face_of(value_at(tree, path)["wall"]).along
    for number, axis in enumerate(along):
        for end, word in (("lower", "from"), ("upper", "to")):
            yield from ask_field(tree, (*path, end, number), f"{name}: {'xyz'[axis]} {word}", "m")


def _ask_wall(tree: Tree, path: Path, name: str) -> Asked:
    wall = yield from ask_choice(
        f"{name}: wall", list(WALLS), str(value_at(tree, (*path, "wall"))), [WALL_WORDS[one] for one in WALLS]
    )
    put(tree, (*path, "wall"), wall)


def _ask_supply(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from _ask_opening(tree, path, name)
    ways = (("flow", "m3/h"), ("speed", "m/s"))
    yield from ask_either(tree, path, f"{name}: flow (120 m3/h) or mean speed (0.5 m/s)", ways)
    value_at(tree, path).setdefault("deviation", "5 %")
    yield from ask_field(tree, (*path, "deviation"), f"{name}: flow, give or take", "%")
    yield from ask_temperature(tree, path, name, _DEVIATIONS[kind])


def _ask_outlet(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from _ask_opening(tree, path, name)
    if len(tree[kind]) > 1:
        yield from ask_field(tree, (*path, "flow"), f"{name}: flow", "m3/h", can_be_open=True)
    yield from ask_temperature(tree, path, name, _DEVIATIONS[kind], can_be_open=True)


def _ask_surface(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from _ask_opening(tree, path, name)
    yield from ask_temperature(tree, path, name, _DEVIATIONS[kind])


def _ask_whole_wall(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from _ask_wall(tree, path, name)
    thing = value_at(tree, path)
    words = ("temperature", "adiabatic")
    told = ("its surface's temperature is known", "it passes no heat")
    default = words[bool(thing.get("adiabatic"))]
    if (yield from ask_choice(f"{name}: known of it", words, default, told)) == "adiabatic":
        thing.pop("temperature", None)
        thing.pop("temperature_deviation", None)
        thing["adiabatic"] = True
    else:
        thing.pop("adiabatic", None)
        thing.setdefault("temperature", "20 C")
        yield from ask_temperature(tree, path, name, _DEVIATIONS[kind])


def _ask_thermometer(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from ask_position(tree, path, name)
    yield from ask_temperature(tree, path, name, _DEVIATIONS[kind])


def _ask_anemometer(tree: Tree, kind: str, path: Path, name: str) -> Asked:
    yield from ask_position(tree, path, name)
    for axis in range(3):
        yield from ask_field(tree, (*path, "velocity", axis), f"{name}: speed along {'xyz'[axis]}", "m/s")
    value_at(tree, path).setdefault("deviation", "0.05 m/s")
    yield from ask_field(tree, (*path, "deviation"), f"{name}: speed, give or take", "m/s")


_ASK: dict[str, Callable[[Tree, str, Path, str], Asked]] = {
    "supply": _ask_supply,
    "outlet": _ask_outlet,
    "surface": _ask_surface,
    "wall": _ask_whole_wall,
    "object": ask_object,
    "thermometer": _ask_thermometer,
    "anemometer": _ask_anemometer,
}
