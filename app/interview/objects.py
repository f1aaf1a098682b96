"""What is asked about people and furniture: a ready one and its place, or a box with its size and its heat."""

from app.interview.ask import Asked, ask_choice, ask_field, ask_position, ask_temperature
from app.interview.conversation import Again
from app.interview.tree import Path, Tree, sentence_at, value_at
from core.objects import READY, ReadyObject

_SIZE = ["0.5 m", "0.5 m", "0.5 m"]
_TEMPERATURE, _HEAT = ("temperature", "temperature_deviation"), ("heat", "heat_deviation")


def ask_object(tree: Tree, _: str, path: Path, name: str) -> Asked:
    """Ask for the object at `path`, called `name` in the questions: kind and place; for a box size and heat too.

    A size or heat that was written for a ready one stays, unless another kind is chosen.
    """
    yield from _ask_kind(tree, path, name)
    if value_at(tree, path)["kind"] == "box":
        yield from _ask_box(tree, path, name)
    else:
        yield from ask_position(tree, path, f"{name}, middle of its foot")


def _ask_kind(tree: Tree, path: Path, name: str) -> Asked:
    thing = value_at(tree, path)
    about = [_told(one) for one in READY.values()]
    kind = yield from ask_choice(f"{name}: what it is", list(READY), thing["kind"], about)
    if kind != thing["kind"]:
        place = thing["position"]
        thing.clear()
        thing.update(kind=kind, position=place)
    if kind == "box":
        thing.setdefault("size", list(_SIZE))
    wrong = sentence_at(tree, (*path, "kind"))
    if wrong:
        yield Again(wrong, 1)


def _told(ready: ReadyObject) -> str:
    """A ready object's size and heat."""
    if ready.size_m is None:
        return "of your own size and heat"
    size = "{:g} x {:g} x {:g} m".format(*ready.size_m)
    heat = (
        "no heat" if ready.power_w is None else f"{ready.power_w:g} W, give or take {ready.power_std_w:g} W"
    )
    return f"{size}, {heat}"


def _ask_box(tree: Tree, path: Path, name: str) -> Asked:
    for axis in range(3):
        yield from ask_field(tree, (*path, "size", axis), f"{name}: size along {'xyz'[axis]}", "m")
    yield from ask_position(tree, path, f"{name}, middle of its foot")
    thing = value_at(tree, path)
    words = ("adiabatic", "temperature", "heat")
    told = (
        "it passes no heat",
        "its surface's temperature is known",
        "the heat is known that it gives to the air",
    )
    default = next((word for word in words[1:] if word in thing), words[0])
    known = yield from ask_choice(f"{name}: known of it", words, default, told)
    for field in {*_TEMPERATURE, *_HEAT} - set({"temperature": _TEMPERATURE, "heat": _HEAT}.get(known, ())):
        thing.pop(field, None)
    if known == "temperature":
        thing.setdefault("temperature", "30 C")
        yield from ask_temperature(tree, path, name, "0.5 K")
    elif known == "heat":
        yield from _ask_heat(tree, path, name)


def _ask_heat(tree: Tree, path: Path, name: str) -> Asked:
    thing = value_at(tree, path)
    thing.setdefault("heat", "100 W")
    yield from ask_field(tree, (*path, "heat"), f"{name}: heat by convection", "W")
    thing.setdefault("heat_deviation", "15 W")
    yield from ask_field(tree, (*path, "heat_deviation"), f"{name}: heat, give or take", "W")
