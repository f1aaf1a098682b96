"""What becomes of a thing that was found and not stated: a sentence, and, where its place is seen, a box in the room.

A room is solved with a found box in it rather than without, since something does stand there. Its heat is not known:
none, as of furniture, and that of a person with a computer are one standard deviation away, and the pictures say the
rest. Where only its direction is seen, the room is solved without it and the intervals do not know of it. So it is in
a projector's light, where a thing and its shadow hide the pattern as one.
"""

from collections.abc import Sequence
from dataclasses import replace

from app.experiment.found import Found
from core.geometry import face_of
from core.objects import RoomObject
from core.problem import ShiftMeasurement
from core.rays.visibility import sees_wall
from core.scene import ProjectedPattern, Scene
from core.setting import SettingError

# Watts, mean and one standard deviation.
_HEAT_W, _HEAT_STD_W = 50.0, 50.0
_SHADOW = "It may be narrower: in a projector's light its shadow hides the pattern too. "


def with_found(scene: Scene, box: RoomObject) -> Scene:
    """The scene with a found box of unknown heat. Raises SettingError where it cannot stand there."""
    warm = replace(box, thermal="power", power_w=_HEAT_W, power_std_w=_HEAT_STD_W)
    return replace(scene, objects=(*scene.objects, warm))


def past_objects(scene: Scene, shifts: Sequence[ShiftMeasurement]) -> list[ShiftMeasurement]:
    """The windows of each view that see past what stands in the scene."""
    return [
        shift.at(sees_wall(scene, view, shift.centres_px, margin_px=float(shift.window_px)))
        for view, shift in enumerate(shifts)
    ]


def told(scene: Scene, found: Found, on_floor: bool) -> Found:
    """The thing with its sentence: what was found, where, and the entry that states it."""
    (x0, x1), (z0, z1), box = found.x_m, found.z_m, found.box
    across = face_of(found.wall).along[0]
    shaded, refused = isinstance(scene.light, ProjectedPattern), ""
    solved = found.depth == "seen" and not shaded
    try:
        with_found(scene, box)
    except SettingError as error:
        solved, refused = False, f" As it is proposed it would be refused: {error}"
    sentence = (
        f"Something that the scene does not state hides {100 * found.share:.1f} % of the wall, "
        f"{'xyz'[across]} {x0:.2f} to {x1:.2f} m, z {z0:.2f} to {z1:.2f} m as seen on it. "
        f"{_place(found, on_floor)} it is {box.size_m[across]:.2f} m "
        f"wide and {box.size_m[2]:.2f} m high; how deep it is cannot be seen. {_SHADOW if shaded else ''}"
        f"{_use(solved)}{refused} State it at the end of experiment.toml, with the heat that it gives, if any (a "
        f'person: thermal = "power", power_w = 75):\n{found.entry.rstrip()}'
    )
    return replace(found, solved=solved, sentence=sentence)


def _place(found: Found, on_floor: bool) -> str:
    face = face_of(found.wall)
    nearest_m = (found.box.lower_m if face.upper else found.box.upper_m)[face.axis]
    at = f"{'xyz'[face.axis]} = {nearest_m:.2f} m"
    if found.depth == "seen":
        return f"Its foot is seen: it stands at {at}, where"
    if found.depth == "at most":
        return (
            f"Its foot is below the picture: it stands at {at} or nearer to the camera; at {nearest_m:.2f} m"
        )
    if on_floor:
        return "Its foot is not seen, so how far before the wall it stands is not known; at the wall"
    return "It does not reach the floor, and how far before the wall it is cannot be seen; at the wall"


def _use(solved: bool) -> str:
    if solved:
        return f"The air is solved with it as a box whose heat is not known ({_HEAT_W:.0f} ± {_HEAT_STD_W:.0f} W)."
    return "The air is solved as if it were not there, and the intervals do not know of it."
