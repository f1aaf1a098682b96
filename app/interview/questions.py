"""What `airlens new` asks, in the order of the page: devices, room, wall, place, further projectors and cameras.

The answers begin as a template's, so that each question has a default, and each answer replaces one of them.
"""

import copy
from collections.abc import Sequence

from app.errors import BadInputError
from app.files.toml import parse, toml_data
from app.interview.ask import Asked, ask_choice, ask_field, ask_number
from app.interview.conversation import Flow, Question, Remark
from app.interview.projectors import PROJECTOR, Inventory, ask_lights, ask_projector
from app.interview.room import ask_room
from app.interview.tree import Tree, value_at
from app.interview.views import ask_lens, ask_views
from app.rig.inventory import CameraChoice
from app.setup.answers import FIRST, Answers
from app.setup.experiment import ANSWERS_FILE, SAMPLE, TEMPLATES, corner_of, room_of, template
from app.setup.scene import picture_told, settings_of

ROOMS = tuple(name for name in TEMPLATES if name != SAMPLE)


def questions(inventory: Inventory) -> Flow:
    """Ask everything; return the answers as `answers.toml` holds them."""
    tree = yield from _ask_devices(inventory.cameras)
    yield Remark(
        "Measure from the room's lower left front corner, as the camera sees it: x to the right, y to the "
        "patterned wall, z up. A number without a unit has the unit of the answer shown."
    )
    yield from ask_room(tree)
    yield from _ask_wall(tree, inventory)
    yield from _ask_place(tree)
    yield from ask_lights(tree, FIRST, inventory)
    yield from ask_views(tree, inventory)
    return tree


def _ask_devices(cameras: Sequence[CameraChoice]) -> Asked:
    """The camera, in the answers of a room to start from."""
    usable = {one.device or one.kind: one for one in cameras if not one.error}
    for one in cameras:
        if one.error:
            yield Remark(f"{one.device}  {one.name}: {one.error}")
    name = yield from ask_choice("Camera", list(usable), "", [one.name for one in usable.values()])
    chosen = usable[name]
    if chosen.kind != "simulated":
        return (yield from _ask_real(chosen))
    tree = toml_data(template(SAMPLE), SAMPLE)
    tree["camera"]["truth"] = yield Question(
        "The room that it looks at (an NPZ file, or sample)", _a_room, SAMPLE
    )
    if tree["camera"]["truth"] == SAMPLE:
        return tree
    start = yield from ask_choice("Start from which room", ROOMS)
    return {**toml_data(template(start), start), "camera": tree["camera"]}


def _a_room(line: str) -> str:
    try:
        corner_of(room_of(line))
    except BadInputError as error:
        raise ValueError(str(error)) from None
    return line


def _ask_real(chosen: CameraChoice) -> Asked:
    formats = {one.text: one for one in chosen.formats}
    taken = formats[
        (yield from ask_choice("Format", list(formats), "", [f"{f.bits} bit" for f in chosen.formats]))
    ]
    start = yield from ask_choice("Start from which room", ROOMS)
    tree = toml_data(template(start), start)
    tree["camera"] |= {
        "kind": chosen.kind,
        "device": chosen.device,
        "pixel_format": taken.pixel_format,
        "bits": taken.bits,
        "width_px": taken.width_px,
        "height_px": taken.height_px,
    }
    yield from ask_number(
        tree, ("camera", "bits"), "Bits of a count (fewer than the format's where the camera has fewer)"
    )
    return tree


def _ask_wall(tree: Tree, inventory: Inventory) -> Asked:
    words = ("print", "projector")
    told = ("a printed pattern hangs on the wall", "a projector shows the pattern")
    default = words["projector" in tree]
    if (yield from ask_choice("Pattern on the wall", words, default, told)) == "print":
        tree.pop("projector", None)
        return
    tree.setdefault("projector", copy.deepcopy(PROJECTOR))
    yield from ask_projector(tree, ("projector",), inventory)


def _ask_place(tree: Tree) -> Asked:
    yield from ask_lens(tree, ("camera",), "Lens: angle of view across (59 deg) or focal length (10 mm)")
    yield from ask_number(tree, ("camera", "width_px"), "Columns of the picture [px]")
    yield from ask_number(tree, ("camera", "height_px"), "Rows of the picture [px]")
    if value_at(tree, ("camera", "position")) is not None:
        for axis in range(3):
            yield from ask_field(tree, ("camera", "position", axis), f"Camera's lens, {'xyz'[axis]}", "m")
    else:
        yield from ask_field(
            tree, ("camera", "distance"), "Distance of the camera to the patterned wall", "m"
        )
    yield Remark(picture_told(settings_of(parse(tree, Answers, ANSWERS_FILE)).scene))
    yield from ask_field(tree, ("camera", "exposure"), "Exposure", "ms", can_be_open=True)
    tree["camera"].setdefault("frames", 100)
    yield from ask_number(tree, ("camera", "frames"), "Frames that are averaged")
