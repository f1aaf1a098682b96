"""What is asked about projectors: where each is, its panel, where it is spoken to, and which light a wall in turn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache

from app.interview.ask import NOTHING, Asked, ask_choice, ask_field, ask_number, ask_position
from app.interview.conversation import Again, Remark
from app.interview.room import counting
from app.interview.tree import Path, Tree, put, sentence_at
from app.rig.inventory import CameraChoice, found_cameras
from app.rig.ports import FoundPort, FoundProjector, found_ports, who_is_there
from app.setup.answers import FIRST

PROJECTOR: Tree = {
    "position": ["1 m", "-1 m", "1.3 m"],
    "width_px": 1920,
    "height_px": 1200,
    "angle_of_view": "40 deg",
}


@dataclass(frozen=True)
class Inventory:
    """What is found on this machine; a port is asked at most once."""

    cameras: Sequence[CameraChoice] = field(default_factory=found_cameras)
    ports: Sequence[FoundPort] = field(default_factory=found_ports)
    who: Callable[[str], FoundProjector | None] = field(default_factory=lambda: cache(who_is_there))


def ask_projector(tree: Tree, place: Path, inventory: Inventory, name: str = "Projector") -> Asked:
    """Ask for the projector that is written at `place`, called `name` in the questions."""
    yield from ask_position(tree, place, f"{name}'s lens")
    yield from ask_field(tree, (*place, "angle_of_view"), f"{name}'s angle of view across", "deg")
    yield from ask_number(tree, (*place, "width_px"), f"{name}'s columns [px]")
    yield from ask_number(tree, (*place, "height_px"), f"{name}'s rows [px]")
    yield from _ask_address(tree, (*place, "url"), inventory, name)


def ask_lights(tree: Tree, owner: str, inventory: Inventory) -> Asked:
    """Ask for further projectors before the camera called `owner`, where its wall has one: a print cannot be dark."""
    first = _on_wall(tree, owner)
    if first is None:
        return
    text = f"A further projector on this wall, which lights it in turn with {{}} before {owner!r}"
    words, told = ("no", "yes"), ("", "a second line of sight without a second camera")
    beside = "the first one"
    while (yield from ask_choice(text.format(beside), words, "no", told)) == "yes":
        lights = tree.setdefault("light", [])
        path, number = ("light", len(lights)), len(lights) + 2
        lights.append(_fresh(first, owner, number))
        asked = yield from counting(_ask_light(tree, path, inventory, f"projector {number}"))
        wrong = sentence_at(tree, path)
        if wrong:
            yield Again(wrong, asked)
        beside = f"{beside} and {lights[-1]['name']!r}"


def _on_wall(tree: Tree, owner: str) -> Tree | None:
    """The projector that the first camera of a camera's wall has told."""
    views = tree.get("view", [])
    wall = next((one["wall"] for one in views if one["name"] == owner and owner != FIRST), "y_max")
    if wall == "y_max":
        return tree.get("projector")
    return next(one for one in views if one["wall"] == wall).get("projector")


def _fresh(first: Tree, owner: str, number: int) -> Tree:
    alike = {name: value for name, value in first.items() if name != "url"}
    alike["position"] = list(first["position"])
    return {"name": f"projector {number}", "camera_of": owner, "pattern_seed": number - 1} | alike


def _ask_light(tree: Tree, path: Path, inventory: Inventory, name: str) -> Asked:
    yield from ask_field(tree, (*path, "name"), f"{name}: what it is called")
    yield from ask_projector(tree, path, inventory, name)


def _ask_address(tree: Tree, path: Path, inventory: Inventory, name: str) -> Asked:
    """A port is asked who is there once somebody chose it: bytes go over its line."""
    devices = [port.device for port in inventory.ports]
    about = [port.description for port in inventory.ports]
    options = [NOTHING, "address", *devices]
    told = [
        "it is switched by hand, or its address is not known yet",
        "its address on the network is known",
        *about,
    ]
    where = yield from ask_choice(f"{name}'s line, over which it is spoken to", options, NOTHING, told)
    if where in devices:
        found = inventory.who(where)
        yield Remark(f"{where}: {f'{found.name}, {found.power}' if found else 'nobody answers'}.")
        put(tree, path, found.url if found else f"escvp21:{where}")
    if where != NOTHING:
        yield from ask_field(tree, path, f"{name}'s address, such as pjlink://192.168.0.20", can_be_open=True)
