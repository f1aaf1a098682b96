"""What is asked about further cameras: the wall, device, lens and distance of each, and the pattern on its wall."""

import copy

from app.files.toml import parse
from app.interview.ask import Asked, ask_choice, ask_count, ask_either, ask_field, ask_number
from app.interview.conversation import Again, Remark
from app.interview.projectors import PROJECTOR, Inventory, ask_lights, ask_projector
from app.interview.room import WALL_WORDS, counting
from app.interview.tree import Path, Tree, put, sentence_at, value_at
from app.setup.answers import Answers
from app.setup.experiment import ANSWERS_FILE
from app.setup.scene import picture_told, settings_of
from core.geometry import WALLS

LENSES = (("angle_of_view", "deg"), ("focal_length", "mm"))
# Of the first camera, what a further one does not have as well until it is asked.
_OWN = ("device", "distance", "position", "truth")


def ask_views(tree: Tree, inventory: Inventory) -> Asked:
    """Ask for the cameras beside the first one, each with the projectors that light its wall in turn."""
    there = tree.get("view", [])
    text = "How many further cameras look at a patterned wall"
    count = yield from ask_count(tree, text, len(there), ("view",))
    tree["view"] = there[:count]
    for number in range(count):
        if number >= len(there):
            tree["view"].append(_fresh(tree, number))
        path = ("view", number)
        asked = yield from counting(_ask_view(tree, path, inventory, f"camera {number + 2}"))
        wrong = sentence_at(tree, path)
        if wrong:
            yield Again(wrong, asked)
        yield Remark(picture_told(settings_of(parse(tree, Answers, ANSWERS_FILE)).scene, number + 1))
        yield from ask_lights(tree, tree["view"][number]["name"], inventory)
    if not count:
        del tree["view"]


def _fresh(tree: Tree, number: int) -> Tree:
    first = tree["camera"]
    view: Tree = {"name": f"camera {number + 2}", "wall": "x_max", "pattern_seed": number + 1}
    view["distance"] = first.get("distance", "3 m")
    device = {} if first["kind"] == "simulated" else {"device": f"/dev/video{2 * number + 2}"}
    return view | device | {name: value for name, value in first.items() if name not in _OWN}


def _ask_view(tree: Tree, path: Path, inventory: Inventory, name: str) -> Asked:
    yield from ask_field(tree, (*path, "name"), f"{name}: what it is called")
    wall = yield from ask_choice(
        f"{name}: wall that it looks at",
        list(WALLS),
        str(value_at(tree, (*path, "wall"))),
        [WALL_WORDS[one] for one in WALLS],
    )
    put(tree, (*path, "wall"), wall)
    if value_at(tree, (*path, "kind")) != "simulated":
        yield from ask_field(tree, (*path, "device"), f"{name}: device, as `airlens devices` lists it")
    yield from ask_lens(
        tree, path, f"{name}: lens, angle of view across (59 deg) or focal length (10 mm)", name
    )
    yield from ask_number(tree, (*path, "width_px"), f"{name}: columns of the picture [px]")
    yield from ask_number(tree, (*path, "height_px"), f"{name}: rows of the picture [px]")
    yield from ask_field(tree, (*path, "distance"), f"{name}: distance to its wall", "m")
    if not _is_lit(tree, path, wall):
        yield from _ask_pattern(tree, path, inventory, name)


def ask_lens(tree: Tree, path: Path, text: str, name: str = "") -> Asked:
    """Ask for the angle of view, or for focal length and pixel pitch."""
    if (yield from ask_either(tree, path, text, LENSES)) == "focal_length":
        value_at(tree, path).setdefault("pixel_pitch", "5.86 um")
        yield from ask_field(
            tree, (*path, "pixel_pitch"), f"{name}: pixel pitch" if name else "Pixel pitch", "um"
        )
    else:
        value_at(tree, path).pop("pixel_pitch", None)


def _is_lit(tree: Tree, path: Path, wall: str) -> bool:
    """Whether a camera before this one looks at the same wall, and has told its pattern."""
    before = [one.get("wall") for one in tree["view"][: int(path[-1])]]
    return wall in ("y_max", *before)


def _ask_pattern(tree: Tree, path: Path, inventory: Inventory, name: str) -> Asked:
    words = ("print", "projector")
    told = ("a printed pattern hangs on its wall", "a projector shows the pattern")
    default = words["projector" in value_at(tree, path)]
    if (yield from ask_choice(f"{name}: pattern on its wall", words, default, told)) == "print":
        put(tree, (*path, "projector"), None)
        return
    value_at(tree, path).setdefault("projector", copy.deepcopy(PROJECTOR))
    yield from ask_projector(tree, (*path, "projector"), inventory, f"{name}: projector")
